/** Keyboard shortcuts of the page; a focused control handles its own keys first. */
import { useEffect } from "preact/hooks";
import { cancelMatch } from "../panels/lights/match/match";
import { showSavedAt } from "../panels/looks/showLook";
import { stopPlacement } from "../panels/lights/placement";
import { helpOpen } from "../state/panels";
import { formatShortcut } from "../ui/chord";
import { SHORTCUTS, handleWipeKey, type Shortcut } from "./shortcuts";

function isTyping(target: EventTarget | null): boolean {
  return (
    target instanceof HTMLElement && target.matches("input:not([type=color]), textarea, select, [contenteditable]")
  );
}

function shortcutOf(event: KeyboardEvent): Shortcut | undefined {
  return SHORTCUTS.find((action) => action.keys.includes(formatShortcut(event)));
}

/** True if the last input came from the pointer. */
let isPointerInput = false;

function onPointerDown(): void {
  isPointerInput = true;
}

function onKeyDown(event: KeyboardEvent): void {
  isPointerInput = false;
  if (event.defaultPrevented || event.altKey) return;
  if (event.key === "Escape") {
    helpOpen.value = false;
    stopPlacement();
    cancelMatch();
  }
  const action = shortcutOf(event);
  if (action === undefined || (isTyping(event.target) && !event.ctrlKey && !event.metaKey)) return;
  // a text field has its own undo
  if (isTyping(event.target) && /z|y/.test(event.key)) return;
  event.preventDefault();
  if (event.key === "[" || event.key === "]") handleWipeKey(event.key);
  else if (/^[1-9]$/.test(event.key)) showSavedAt(Number(event.key));
  else if (!(event.repeat && action.release !== undefined)) action.run();
}

function onKeyUp(event: KeyboardEvent): void {
  for (const action of SHORTCUTS) if (action.keys.includes(event.key.toLowerCase())) action.release?.();
}

/** Return the keys to the page after a pointer selection in a list: else the next letter would select again. */
function onSelectChange({ target }: Event): void {
  if (target instanceof HTMLSelectElement && isPointerInput) target.blur();
}

export function useKeyboard(): void {
  useEffect(() => {
    const release = () => SHORTCUTS.forEach((action) => action.release?.());
    window.addEventListener("keydown", onKeyDown);
    window.addEventListener("keyup", onKeyUp);
    window.addEventListener("pointerdown", onPointerDown, { capture: true });
    window.addEventListener("change", onSelectChange);
    window.addEventListener("blur", release);
    return () => {
      window.removeEventListener("keydown", onKeyDown);
      window.removeEventListener("keyup", onKeyUp);
      window.removeEventListener("pointerdown", onPointerDown, { capture: true });
      window.removeEventListener("change", onSelectChange);
      window.removeEventListener("blur", release);
    };
  }, []);
}
