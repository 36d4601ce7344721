/** Closes a menu on a press outside of it. */
import { useEffect } from "preact/hooks";

/** Call `close` on a press outside an open menu. */
export function useDismiss(open: boolean, menu: { current: HTMLElement | null }, close: () => void): void {
  useEffect(() => {
    if (!open) return undefined;
    const press = (event: PointerEvent) => {
      if (!menu.current?.contains(event.target as Node)) close();
    };
    window.addEventListener("pointerdown", press, { capture: true });
    return () => window.removeEventListener("pointerdown", press, { capture: true });
  }, [open, menu, close]);
}
