import type { Signal } from "@preact/signals";
import { IconButton } from "./Button";
import type { IconName } from "./Icon";

/** A button with an icon that turns something on and off. */
interface Props {
  icon: IconName;
  label: string;
  keys?: string;
  of: Signal<boolean>;
}

export function Switch({ of, ...button }: Props) {
  return <IconButton {...button} pressed={of.value} onClick={() => (of.value = !of.value)} />;
}
