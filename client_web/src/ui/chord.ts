/** The chord of an event, such as "Ctrl+Shift+z"; without Ctrl, Shift is omitted because it selects the character. */
export function formatShortcut(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey">): string {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (!event.ctrlKey && !event.metaKey) return key;
  return `Ctrl+${event.shiftKey ? "Shift+" : ""}${key}`;
}

/** A key or chord for tooltips and the shortcut list: letters in upper case. */
export function keyName(keys: string): string {
  return keys.replace(/[a-z]$/, (letter) => (/(^|\+)[a-z]$/.test(keys) ? letter.toUpperCase() : letter));
}
