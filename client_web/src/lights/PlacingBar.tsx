/** While a light is being placed: what to do, a way without the pointer, and the way out. */
import { useEffect, useRef } from "preact/hooks";
import { KINDS } from "./kinds";
import { placeInTheMiddle, placing, stopAdding } from "./place";

export function PlacingBar() {
  const middle = useRef<HTMLButtonElement>(null);
  const kind = placing.value;
  useEffect(() => middle.current?.focus(), [kind]);
  const words = KINDS.find((each) => each.kind === kind);
  if (words === undefined) return null;
  return (
    <div class="placing" role="group" aria-label={`Place a light: ${words.label}`}>
      <span role="status">Click where to {words.click}</span>
      <button ref={middle} onClick={placeInTheMiddle}>
        In the middle
      </button>
      <button title="Add no light (Esc)" onClick={stopAdding}>
        Cancel
      </button>
    </div>
  );
}
