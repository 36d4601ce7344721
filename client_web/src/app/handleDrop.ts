/** Files dropped on the editor: each is imported by its type; unsupported ones are reported. */
import type { DroppedFile } from "../start/files/dropTypes";
import { isEnvironment, isMeasuredFile } from "../start/files/sceneFiles";
import { editorRejection } from "../start/files/rejections";
import { isTextureFile, applyImageFiles, consumeDropTarget } from "../panels/inspector/images/importImages";
import { importLutFile, isLutFile } from "../panels/looks/displayLuts";
import { applyLookFile, isLookFile } from "../panels/looks/lookFiles";
import { importMaterials } from "../panels/library/libraryItems";
import { importEnvironmentFile } from "../panels/scene/environments";
import { clearErrors, showError } from "../ui/toasts";

export function handleDrop(dropped: readonly DroppedFile[]): void {
  clearErrors("files"); // of earlier drops
  const targetMaterial = consumeDropTarget();
  const files = dropped.map(({ file }) => file);
  const environments = files.filter((file) => isEnvironment(file) && !isTextureFile(file));
  const measured = files.filter(isMeasuredFile);
  const images = files.filter(isTextureFile);
  const droppedLuts = files.filter(isLutFile).slice(0, 1);
  const looks = files.filter(isLookFile).slice(0, 1);
  if (environments.length > 0) void importEnvironmentFile(environments);
  if (measured.length > 0) void importMaterials(measured);
  if (images.length > 0) void applyImageFiles(images, targetMaterial);
  for (const file of droppedLuts) void importLutFile(file);
  for (const file of looks) void applyLookFile(file);
  const accepted = new Set([...environments, ...measured, ...images, ...droppedLuts, ...looks]);
  // a folder may also hold unrelated files
  const rejected = dropped.filter(
    ({ path, file }) => !accepted.has(file) && (accepted.size === 0 || !path.includes("/")),
  );
  if (rejected.length > 0) showError(editorRejection(rejected), "files");
  else if (dropped.length === 0) showError("This folder is empty. Nothing changed.", "files");
}
