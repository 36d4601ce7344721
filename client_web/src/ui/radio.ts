/** Arrow keys in a group of radio buttons: they move along and choose, round the ends. */

const STEPS: Record<string, number> = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 };

/** Hear a key of the group, of whose `count` buttons one is chosen. */
export function onRadioKey(event: KeyboardEvent, count: number, selectedIndex: number, select: (index: number) => void): void {
  const step = STEPS[event.key];
  if (step === undefined || event.ctrlKey || event.metaKey || event.altKey) return;
  event.preventDefault();
  event.stopPropagation();
  const next = (selectedIndex + step + count) % count;
  (event.currentTarget as HTMLElement).querySelectorAll<HTMLElement>("[role=radio]")[next]?.focus();
  select(next);
}
