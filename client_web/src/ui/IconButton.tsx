import type { ComponentChildren } from "preact";
import { Icon, type IconName } from "./Icon";

interface IconButtonProps {
  icon: IconName;
  /** Accessible name and tooltip. */
  label: string;
  keys?: string;
  pressed?: boolean;
  /** For a button that opens something: whether it is open. */
  expanded?: boolean;
  disabled?: boolean;
  onClick: () => void;
  children?: ComponentChildren;
}

/** A small button with an icon and, if there are children, a label beside it. */
export function IconButton({ icon, label, keys, pressed, expanded, disabled, onClick, children }: IconButtonProps) {
  return (
    <button
      type="button"
      class={children === undefined ? "icon" : ""}
      title={keys === undefined ? label : `${label} (${keys})`}
      aria-label={children === undefined ? label : undefined}
      aria-pressed={pressed}
      aria-expanded={expanded}
      disabled={disabled}
      onClick={onClick}
    >
      <Icon name={icon} />
      {children}
    </button>
  );
}
