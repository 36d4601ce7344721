/** A name that a press turns into a field: Enter or leaving takes what was typed, Escape leaves it as it was. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";

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

export function EditableName({ name, class: className, maximum, editing = false, onRename, onDone }: Props) {
  const [open, setOpen] = useState(editing);
  const button = useRef<HTMLButtonElement>(null);
  const isKeyboard = useRef(false);
  useLayoutEffect(() => {
    if (isKeyboard.current) button.current?.focus(); // the field had it
    isKeyboard.current = false;
  }, [open]);
  if (!open) {
    return (
      <button ref={button} type="button" class={className} title={`${name}: rename`} aria-label={`${name}: rename`} onClick={() => setOpen(true)}>
        {name}
      </button>
    );
  }
  const close = () => {
    setOpen(false);
    onDone?.();
  };
  const submit = (text: string) => {
    close();
    const next = text.trim().slice(0, maximum);
    if (next !== "" && next !== name) onRename(next);
  };
  return (
    <input
      class={className}
      aria-label={`New name of ${name}`}
      maxLength={maximum}
      defaultValue={name}
      ref={(input) => input?.focus()}
      onFocus={(event) => event.currentTarget.select()}
      onBlur={(event) => submit(event.currentTarget.value)}
      onKeyDown={(event) => {
        event.stopPropagation();
        if (event.key === "Escape") event.currentTarget.value = name;
        if (event.key !== "Enter" && event.key !== "Escape") return;
        event.preventDefault(); // else the button, which has the focus by then, is pressed
        isKeyboard.current = true;
        event.currentTarget.blur();
      }}
    />
  );
}
