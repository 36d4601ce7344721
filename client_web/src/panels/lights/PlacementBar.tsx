/** While a light is being placed: what to do, a way without the pointer, and the way out. */
import { useEffect, useRef } from "preact/hooks";
import { LIGHT_KINDS } from "./lightKinds";
import { placeAtCenterOf, placingKind, stopPlacement } from "./placement";

/** The bar goes, and with it the focus: the keys go on here. */
function focusOn(selector: string): void {
  requestAnimationFrame(() => document.querySelector<HTMLElement>(selector)?.focus());
}

async function placeAtCenter(): Promise<void> {
  await placeAtCenterOf();
  if (placingKind.peek() === null) focusOn(".light.selected .name");
}

function cancelPlacement(): void {
  stopPlacement();
  focusOn("[aria-label='Add a light']");
}

export function PlacementBar() {
  const middle = useRef<HTMLButtonElement>(null);
  const kind = placingKind.value;
  useEffect(() => middle.current?.focus(), [kind]);
  const kindLabels = LIGHT_KINDS.find((candidate) => candidate.kind === kind);
  if (kindLabels === undefined) return null;
  return (
    <div class="placing" role="group" aria-label={`Place a light: ${kindLabels.label}`}>
      <span role="status">Click where to {kindLabels.click}</span>
      <button ref={middle} onClick={() => void placeAtCenter()}>
        In the middle
      </button>
      <button title="Add no light (Esc)" onClick={cancelPlacement}>
        Cancel
      </button>
    </div>
  );
}
