/** Files that were dropped on the editor: each goes where its kind belongs, and what has no place is said. */
import type { Dropped } from "../files/dropped";
import { isEnvironment, isMeasured, isTextureLike } from "../files/files";
import { refusalInEditor } from "../files/refusals";
import { isTexture, takeImages, takeTarget } from "../images/taking";
import { importMaterials } from "../library/library";
import { take } from "../outline/environments";
import { mended, showError } from "../ui/toasts";

export function takeDropped(dropped: readonly Dropped[]): void {
  mended("files"); // what was wrong with those before
  const over = takeTarget();
  const files = dropped.map(({ file }) => file);
  const environments = files.filter((file) => isEnvironment(file) && !isTexture(file));
  const measured = files.filter(isMeasured);
  const images = files.filter((file) => isTexture(file) || isTextureLike(file));
  if (environments.length > 0) void take(environments);
  if (measured.length > 0) void importMaterials(measured);
  if (images.some(isTexture)) void takeImages(images, over);
  const taken = new Set([...environments, ...measured, ...(images.some(isTexture) ? images : [])]);
  // a folder may hold anything beside what is of use
  const others = dropped.filter(({ path, file }) => !taken.has(file) && (taken.size === 0 || !path.includes("/")));
  if (others.length > 0) showError(refusalInEditor(others), "files");
  else if (dropped.length === 0) showError("The folder is empty. Nothing was changed.", "files");
}
