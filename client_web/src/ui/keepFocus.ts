/** The keyboard's place: when what has the focus goes, what is nearest gets it, or what had it before a panel opened. */
import { useLayoutEffect } from "preact/hooks";

const FOCUSABLE = "button:not(:disabled), input:not(:disabled), select:not(:disabled), textarea, a[href], canvas[tabindex='0'], [tabindex='0']";

/** What has the focus, and all that it is in, each with its place among its neighbors. */
interface Step {
  element: Element;
  index: number;
}

let path: Step[] = [];
let byKeys = false;

function pathOf(element: Element | null): Step[] {
  if (element?.parentElement == null) return [];
  return [{ element, index: [...element.parentElement.children].indexOf(element) }, ...pathOf(element.parentElement)];
}

const isReachable = (element: HTMLElement): boolean => element.checkVisibility() && element.closest("[inert]") === null;

function firstIn(root: Element): HTMLElement | undefined {
  const inside = root.matches(FOCUSABLE) ? [root as HTMLElement] : [];
  return [...inside, ...root.querySelectorAll<HTMLElement>(FOCUSABLE)].find(isReachable);
}

/** What stands now where a removed element stood, or the first control around it. */
export function nearest(steps: readonly Step[]): HTMLElement | undefined {
  const home = steps.findIndex(({ element }) => element.isConnected);
  if (home < 1) return undefined;
  const { children } = (steps[home] as Step).element;
  const inPlace = children[Math.min((steps[home - 1] as Step).index, children.length - 1)];
  const around = steps.slice(home).map(({ element }) => firstIn(element));
  return (inPlace && firstIn(inPlace)) ?? around.find((found) => found !== undefined);
}

function mend(): void {
  const [last] = path;
  const { activeElement, body } = document;
  if (!byKeys || last === undefined || last.element.isConnected || (activeElement !== null && activeElement !== body)) return;
  nearest(path)?.focus();
}

/** Follow the focus of the page. */
export function keepFocus(): void {
  window.addEventListener("keydown", () => (byKeys = true), { capture: true });
  window.addEventListener("pointerdown", () => (byKeys = false), { capture: true });
  window.addEventListener("focusin", ({ target }) => (path = pathOf(target as Element)));
  // what leaves the focus by itself, as a field does with Escape, wants the page's keys
  window.addEventListener("focusout", ({ target, relatedTarget }) => {
    if (relatedTarget !== null) return;
    queueMicrotask(() => {
      if ((target as Element).isConnected && path[0]?.element === target) path = [];
    });
  });
  new MutationObserver(mend).observe(document.body, { childList: true, subtree: true });
}

/** A panel gives the focus back to what had it when it opened. `toPage`: where nothing had it, the keys are the page's
 * again; else what is nearest gets it. */
export function useReturnFocus(panel: { current: HTMLElement | null }, toPage = false): void {
  useLayoutEffect(() => {
    const [opened, before] = [panel.current, document.activeElement];
    return () => {
      const isInside = opened?.contains(document.activeElement) ?? false;
      if (!isInside || !(before instanceof HTMLElement) || !before.isConnected) return;
      before.focus();
      if (before === document.body && toPage) path = [];
    };
  }, []);
}
