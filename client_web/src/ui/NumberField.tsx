/** A number field: Enter or blur applies, Escape cancels, arrows step. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { history } from "../edit/history";
import { formatNumber, parseNumber } from "./scale";
import { showNote } from "./toasts";

interface Props {
  value: number;
  label: string;
  minimum: number;
  maximum: number;
  step: number;
  /** Integers only. */
  isInteger?: boolean;
  autoFocus?: boolean;
  /** Text typed before the field opened. */
  initialText?: string;
  /** Reads typed text; null if it is invalid. */
  parse?: (text: string) => number | null;
  onChange: (value: number) => void;
  /** Called when the field is left; `isKeyboard`: by Enter or Escape, so that the focus can move on. */
  onDone?: (isKeyboard: boolean) => void;
}

export function NumberField({
  value,
  label,
  minimum,
  maximum,
  step,
  isInteger = false,
  autoFocus,
  initialText,
  parse = parseNumber,
  onChange,
  onDone,
}: Props) {
  const input = useRef<HTMLInputElement>(null);
  const [draft, setDraft] = useState<string | null>(initialText ?? null);
  const isRejected = useRef(false);
  const isKeyboard = useRef(false);
  const wrong = draft !== null && parse(draft) === null;
  useLayoutEffect(() => {
    if (!autoFocus) return;
    input.current?.focus();
    if (initialText === undefined) input.current?.select();
  }, [autoFocus, initialText]);

  const displayedText = isInteger ? String(Math.round(value)) : formatNumber(value);
  const setValue = (next: number) =>
    onChange(Math.min(maximum, Math.max(minimum, isInteger ? Math.round(next) : next)));
  const submit = () => {
    const typed = draft !== null && draft !== displayedText && !isRejected.current;
    const next = typed ? parse(draft) : null;
    if (next !== null) {
      const clamped = Math.min(maximum, Math.max(minimum, next));
      if (clamped !== next)
        showNote(
          `${label}: ${formatNumber(next)} is out of range (${formatNumber(minimum)}–${formatNumber(maximum)}); set to ${formatNumber(clamped)}.`,
        );
      // a typed number is its own history step
      history.endGesture();
      setValue(next);
      history.endGesture();
    }
    isRejected.current = false;
    setDraft(null);
  };
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    // leave the field, so that the next key is a shortcut again
    if (event.key === "Enter" || event.key === "Escape") {
      isRejected.current = event.key === "Escape";
      isKeyboard.current = true;
      input.current?.blur();
    } else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      event.preventDefault();
      const size = step * (event.shiftKey ? 0.1 : 1);
      setValue(Number((value + (event.key === "ArrowUp" ? size : -size)).toPrecision(10)));
      setDraft(null);
    }
  };
  return (
    <input
      ref={input}
      class="number"
      type="text"
      inputMode="decimal"
      autocomplete="off"
      aria-label={label}
      aria-invalid={wrong}
      title={wrong ? `Enter a number from ${minimum} to ${maximum}` : undefined}
      value={draft ?? displayedText}
      onFocus={(event) => draft === null && event.currentTarget.select()}
      onInput={(event) => setDraft(event.currentTarget.value)}
      onBlur={() => {
        submit();
        onDone?.(isKeyboard.current);
        isKeyboard.current = false;
      }}
      onKeyDown={key}
    />
  );
}
