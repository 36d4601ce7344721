/** Bar shown while placing a light: the instruction, placing without the pointer, and cancel. */
import { useEffect, useRef } from "preact/hooks";
import { LIGHT_KINDS } from "./lightKinds";
import { placeAtCenterOf, placingKind, stopPlacement } from "./placement";

/** Move the focus here when the bar closes. */
function focusOn(selector: string): void {
  requestAnimationFrame(() => document.querySelector<HTMLElement>(selector)?.focus());
}

async function placeAtCenter(): Promise<void> {
  await placeAtCenterOf();
  if (placingKind.peek() === null) focusOn(".light.selected .name");
}

function cancelPlacement(): void {
  stopPlacement();
  focusOn("[aria-label='Add light']");
}

export function PlacementBar() {
  const middle = useRef<HTMLButtonElement>(null);
  const kind = placingKind.value;
  useEffect(() => middle.current?.focus(), [kind]);
  const kindLabels = LIGHT_KINDS.find((candidate) => candidate.kind === kind);
  if (kindLabels === undefined) return null;
  return (
    <div class="placing" role="group" aria-label={`Place a light: ${kindLabels.label}`}>
      <span role="status">Click a surface to {kindLabels.click}</span>
      <button ref={middle} onClick={() => void placeAtCenter()}>
        Place in center
      </button>
      <button title="Cancel (Esc)" onClick={cancelPlacement}>
        Cancel
      </button>
    </div>
  );
}
