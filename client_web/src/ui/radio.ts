/** Arrow keys in a radio group: move and select, with wrap-around. */

const STEPS: Record<string, number> = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** Handle a key in a group of `count` buttons. */
export function onRadioKey(
  event: KeyboardEvent,
  count: number,
  selectedIndex: number,
  select: (index: number) => void,
): void {
  const step = STEPS[event.key];
  if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  event.stopPropagation();
  const next = (selectedIndex + step + count) % count;
  (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=radio]")[next]?.focus();
  select(next);
}
