/** A name that a press turns into a field: Enter or leaving takes what was typed, Escape leaves it as it was. */
import { useState } from "preact/hooks";

interface Props {
  name: string;
  /** Of both, the button and the field. */
  class: string;
  maximum: number;
  /** What is typed for something new comes up selected, to be typed over at once. */
  editing?: boolean;
  onRename(name: string): void;
  onDone?(): void;
}

export function EditableName({ name, class: of, maximum, editing = false, onRename, onDone }: Props) {
  const [open, setOpen] = useState(editing);
  if (!open) {
    return (
      <button type="button" class={of} title={`${name}: rename`} aria-label={`${name}: rename`} onClick={() => setOpen(true)}>
        {name}
      </button>
    );
  }
  const close = () => {
    setOpen(false);
    onDone?.();
  };
  const take = (text: string) => {
    close();
    const next = text.trim().slice(0, maximum);
    if (next !== "" && next !== name) onRename(next);
  };
  return (
    <input
      class={of}
      aria-label={`New name of ${name}`}
      maxLength={maximum}
      defaultValue={name}
      ref={(input) => input?.focus()}
      onFocus={(event) => event.currentTarget.select()}
      onBlur={(event) => take(event.currentTarget.value)}
      onKeyDown={(event) => {
        event.stopPropagation();
        if (event.key === "Enter") event.currentTarget.blur();
        if (event.key === "Escape") {
          event.currentTarget.value = name;
          event.currentTarget.blur();
        }
      }}
    />
  );
}
