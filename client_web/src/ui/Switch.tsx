import type { Signal } from "@preact/signals";
import { IconButton } from "./Button";
import type { IconName } from "./Icon";

/** A button with an icon that turns something on and off. */
export function Switch({ icon, label, of }: { icon: IconName; label: string; of: Signal<boolean> }) {
  return <IconButton icon={icon} label={label} pressed={of.value} onClick={() => (of.value = !of.value)} />;
}
