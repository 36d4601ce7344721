/** While a light is being placed: what to do, a way without the pointer, and the way out. */
import { useEffect, useRef } from "preact/hooks";
import { KINDS } from "./kinds";
import { placeInTheMiddle, placing, stopAdding } from "./placing";

/** The bar goes, and with it the focus: the keys go on here. */
function focusOn(selector: string): void {
  requestAnimationFrame(() => document.querySelector<HTMLElement>(selector)?.focus());
}

async function putInTheMiddle(): Promise<void> {
  await placeInTheMiddle();
  if (placing.peek() === null) focusOn(".light.selected .name");
}

function cancel(): void {
  stopAdding();
  focusOn("[aria-label='Add a light']");
}

export function PlacingBar() {
  const middle = useRef<HTMLButtonElement>(null);
  const kind = placing.value;
  useEffect(() => middle.current?.focus(), [kind]);
  const words = KINDS.find((each) => each.kind === kind);
  if (words === undefined) return null;
  return (
    <div class="placing" role="group" aria-label={`Place a light: ${words.label}`}>
      <span role="status">Click where to {words.click}</span>
      <button ref={middle} onClick={() => void putInTheMiddle()}>
        In the middle
      </button>
      <button title="Add no light (Esc)" onClick={cancel}>
        Cancel
      </button>
    </div>
  );
}
