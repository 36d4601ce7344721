/** "Ctrl+Shift+z" of an event; Shift is only named beside Ctrl, as it decides which character a key is. */
export function formatShortcut(event: Pick<KeyboardEvent, "key" | "ctrlKey" | "metaKey" | "shiftKey">): string {
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  if (!event.ctrlKey && !event.metaKey) return key;
  return `Ctrl+${event.shiftKey ? "Shift+" : ""}${key}`;
}

/** A key or chord as tooltips and the keyboard map write it: letters in upper case. */
export function keyName(keys: string): string {
  return keys.replace(/[a-z]$/, (letter) => (/(^|\+)[a-z]$/.test(keys) ? letter.toUpperCase() : letter));
}
