/** Where each view's picture lies on its canvas: every view has its own place, and another one beside others. */
import { alonePlaces, besidePlaces, sideBySide } from "../state/store";
import { FIT, type Transform } from "./transform";

const places = () => (sideBySide.value ? besidePlaces : alonePlaces);

export function transformOf(view: string): Transform {
  return places().value.get(view) ?? FIT;
}

export function moveTo(view: string, transform: Transform): void {
  const table = places();
  table.value = new Map(table.peek()).set(view, transform);
}
