/** Solo: one material as it is, the others in dim grey. */
import { selectedMaterial, solo } from "./store";

/** The material that is alone after the switch was pressed with `selected` selected. */
export function nextSolo(current: string | null, selected: string | null): string | null {
  return selected === null || selected === current ? null : selected;
}

export function toggleSolo(): void {
  solo.value = nextSolo(solo.value, selectedMaterial.value);
}
