/** Whether lights are being matched, and which of them stay meanwhile. */
import { signal } from "@preact/signals";

export const isMatchOpen = signal(false);
/** JSON pointers of the lights that stay. */
export const lockedPointers = signal<ReadonlySet<string>>(new Set());

export function toggleLock(pointer: string): void {
  const locked = new Set(lockedPointers.value);
  if (!locked.delete(pointer)) locked.add(pointer);
  lockedPointers.value = locked;
}
