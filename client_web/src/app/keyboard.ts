/** Keys of the whole page; controls that have the focus take theirs first. */
import { useEffect } from "preact/hooks";
import { stopAdding } from "../lights/placing";
import { helpOpen } from "../state/panels";
import { chord } from "../ui/chord";
import { ACTIONS, onWipeKey, type Action } from "./actions";

function typing(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement && target.matches("input:not([type=color]), textarea, select, [contenteditable]")
  );
}

function actionOf(event: KeyboardEvent): Action | undefined {
  return ACTIONS.find((action) => action.keys.includes(chord(event)));
}

/** Whether the pointer was used last. */
let byPointer = false;

function point(): void {
  byPointer = true;
}

function down(event: KeyboardEvent): void {
  byPointer = false;
  if (event.defaultPrevented || event.altKey) return;
  if (event.key === "Escape") {
    helpOpen.value = false;
    stopAdding();
  }
  const action = actionOf(event);
  if (action === undefined || (typing(event.target) && !event.ctrlKey && !event.metaKey)) return;
  // in a field, undo is the field's own
  if (typing(event.target) && /z|y/.test(event.key)) return;
  event.preventDefault();
  if (event.key === "[" || event.key === "]") onWipeKey(event.key);
  else if (!(event.repeat && action.release !== undefined)) action.run();
}

function up(event: KeyboardEvent): void {
  for (const action of ACTIONS) if (action.keys.includes(event.key.toLowerCase())) action.release?.();
}

/** A list that the pointer chose from gives the keys back: else the next letter would choose again. */
function chosen({ target }: Event): void {
  if (target instanceof HTMLSelectElement && byPointer) target.blur();
}

export function useKeyboard(): void {
  useEffect(() => {
    const release = () => ACTIONS.forEach((action) => action.release?.());
    window.addEventListener("keydown", down);
    window.addEventListener("keyup", up);
    window.addEventListener("pointerdown", point, { capture: true });
    window.addEventListener("change", chosen);
    window.addEventListener("blur", release);
    return () => {
      window.removeEventListener("keydown", down);
      window.removeEventListener("keyup", up);
      window.removeEventListener("pointerdown", point, { capture: true });
      window.removeEventListener("change", chosen);
      window.removeEventListener("blur", release);
    };
  }, []);
}
