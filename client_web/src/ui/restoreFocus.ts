/** Restores keyboard focus: after the focused element is removed, focus the nearest one, or the one focused before a
 * panel opened. */
import { useLayoutEffect } from "preact/hooks";

const FOCUSABLE = "button:not(:disabled), input:not(:disabled), select:not(:disabled), textarea, a[href], canvas[tabindex='0'], [tabindex='0']";

/** The focused element and its ancestors, each with its index among its siblings. */
interface PathStep {
  element: Element;
  index: number;
}

let focusPath: PathStep[] = [];
let isKeyboardFocus = false;

function pathToRoot(element: Element | null): PathStep[] {
  if (element?.parentElement == null) return [];
  return [{ element, index: [...element.parentElement.children].indexOf(element) }, ...pathToRoot(element.parentElement)];
}

const isReachable = (element: HTMLElement): boolean => element.checkVisibility() && element.closest("[inert]") === null;

function firstFocusable(root: Element): HTMLElement | undefined {
  const inside = root.matches(FOCUSABLE) ? [root as HTMLElement] : [];
  return [...inside, ...root.querySelectorAll<HTMLElement>(FOCUSABLE)].find(isReachable);
}

/** The element now at a removed element's position, or the first control around it. */
export function nearestFocusable(steps: readonly PathStep[]): HTMLElement | undefined {
  const home = steps.findIndex(({ element }) => element.isConnected);
  if (home < 1) return undefined;
  const { children } = (steps[home] as PathStep).element;
  const inPlace = children[Math.min((steps[home - 1] as PathStep).index, children.length - 1)];
  const around = steps.slice(home).map(({ element }) => firstFocusable(element));
  return (inPlace && firstFocusable(inPlace)) ?? around.find((candidate) => candidate !== undefined);
}

function restoreFocus(): void {
  const [last] = focusPath;
  const { activeElement, body } = document;
  if (!isKeyboardFocus || last === undefined || last.element.isConnected || (activeElement !== null && activeElement !== body)) return;
  nearestFocusable(focusPath)?.focus();
}

/** Track the page's focus. */
export function trackFocus(): void {
  window.addEventListener("keydown", () => (isKeyboardFocus = true), { capture: true });
  window.addEventListener("pointerdown", () => (isKeyboardFocus = false), { capture: true });
  window.addEventListener("focusin", ({ target }) => (focusPath = pathToRoot(target as Element)));
  // an element that blurs itself, like a field on Escape, returns the keys to the page
  window.addEventListener("focusout", ({ target, relatedTarget }) => {
    if (relatedTarget !== null) return;
    queueMicrotask(() => {
      if ((target as Element).isConnected && focusPath[0]?.element === target) focusPath = [];
    });
  });
  new MutationObserver(restoreFocus).observe(document.body, { childList: true, subtree: true });
}

/** Return the focus to the element that had it before a panel opened. If none had it: to the page with `toPage`, else
 * to the nearest element. */
export function useReturnFocus(panel: { current: HTMLElement | null }, toPage = false): void {
  useLayoutEffect(() => {
    const [opened, previousFocus] = [panel.current, document.activeElement];
    return () => {
      const isInside = opened?.contains(document.activeElement) ?? false;
      if (!isInside || !(previousFocus instanceof HTMLElement) || !previousFocus.isConnected) return;
      previousFocus.focus();
      if (previousFocus === document.body && toPage) focusPath = [];
    };
  }, [panel, toPage]);
}
