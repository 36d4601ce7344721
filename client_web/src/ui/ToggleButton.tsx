import type { Signal } from "@preact/signals";
import { IconButton } from "./IconButton";
import type { IconName } from "./Icon";

/** An icon button that toggles a signal. */
interface Props {
  icon: IconName;
  label: string;
  keys?: string;
  state: Signal<boolean>;
}

export function ToggleButton({ state, ...button }: Props) {
  return <IconButton {...button} pressed={state.value} onClick={() => (state.value = !state.value)} />;
}
