/** Lock of a light while lights are matched: it stays as it is. */
import { IconButton } from "../../ui/IconButton";
import { lockedPointers, toggleLock } from "../../state/match";

export function MatchLock({ label, pointer }: { label: string; pointer: string }) {
  const isLocked = lockedPointers.value.has(pointer);
  return (
    <IconButton
      icon="lock"
      label={isLocked ? `Unlock ${label}` : `Lock ${label} while matching`}
      pressed={isLocked}
      onClick={() => toggleLock(pointer)}
    />
  );
}
