/** A name that turns into a text field when pressed: Enter or blur applies, Escape cancels. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";

interface Props {
  name: string;
  /** CSS class of the button and the field. */
  class: string;
  maximum: number;
  /** Open with the name selected, for new objects. */
  editing?: boolean;
  onRename: (name: string) => void;
  onDone?: () => void;
}

export function EditableName({ name, class: className, maximum, editing = false, onRename, onDone }: Props) {
  const [open, setOpen] = useState(editing);
  const button = useRef<HTMLButtonElement>(null);
  const isKeyboard = useRef(false);
  useLayoutEffect(() => {
    if (isKeyboard.current) button.current?.focus(); // the field had the focus
    isKeyboard.current = false;
  }, [open]);
  if (!open) {
    return (
      <button ref={button} type="button" class={className} title={`Rename ${name}`} aria-label={`Rename ${name}`} onClick={() => setOpen(true)}>
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
        event.preventDefault(); // otherwise the key would press the button, which has the focus by then
        isKeyboard.current = true;
        event.currentTarget.blur();
      }}
    />
  );
}
