/** White balance of the display: by sliders, or from a gray in the image. */
import { editValue } from "../../edit/edit";
import { balanceForGray } from "../../render/color/whiteBalance";
import type { Rgb } from "../../protocol";
import { isPickingGray } from "../../state/display";
import { look } from "../../state/look";
import { showNote } from "../../ui/toasts";

/** Set the white balance that makes a radiance gray. */
export function makeGray(radiance: Rgb | null): void {
  isPickingGray.value = false;
  const balance = radiance === null ? null : balanceForGray(radiance);
  const display = look.peek()?.display;
  if (display === undefined) return;
  if (balance === null) showNote("Too dark or too saturated for a gray. Pick a brighter, grayer surface.");
  else editValue("White balance", "/display", { ...display, ...balance });
}
