/** A number that is typed: Enter or leaving takes it, Escape leaves it as it was, arrows step it. */
import { useLayoutEffect, useRef, useState } from "preact/hooks";
import { history } from "../edit/history";
import { formatNumber, parseNumber } from "./scale";
import { note } from "./toasts";

interface Props {
  value: number;
  label: string;
  minimum: number;
  maximum: number;
  step: number;
  /** Shown, and taken, without what follows the point. */
  whole?: boolean;
  autoFocus?: boolean;
  /** What has been typed already, before the field was there. */
  begun?: string;
  onChange(value: number): void;
  /** It is left; `byKey`: with Enter or Escape, so that the focus is free. */
  onDone?(byKey: boolean): void;
}

export function NumberField({ value, label, minimum, maximum, step, whole = false, autoFocus, begun, onChange, onDone }: Props) {
  const input = useRef<HTMLInputElement>(null);
  const [draft, setDraft] = useState<string | null>(begun ?? null);
  const refused = useRef(false);
  const byKey = useRef(false);
  const wrong = draft !== null && parseNumber(draft) === null;
  useLayoutEffect(() => {
    if (!autoFocus) return;
    input.current?.focus();
    if (begun === undefined) input.current?.select();
  }, [autoFocus]);

  const shown = whole ? String(Math.round(value)) : formatNumber(value);
  const put = (next: number) => onChange(Math.min(maximum, Math.max(minimum, whole ? Math.round(next) : next)));
  const take = () => {
    const typed = draft !== null && draft !== shown && !refused.current;
    const next = typed ? parseNumber(draft) : null;
    if (next !== null) {
      const taken = Math.min(maximum, Math.max(minimum, next));
      if (taken !== next)
        note(`${label}: ${formatNumber(next)} is beyond ${formatNumber(minimum)} to ${formatNumber(maximum)}; it became ${formatNumber(taken)}.`);
      // a number that was typed is a step by itself
      history.seal();
      put(next);
      history.seal();
    }
    refused.current = false;
    setDraft(null);
  };
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    // the field is left, so that the next key is the page's again
    if (event.key === "Enter" || event.key === "Escape") {
      refused.current = event.key === "Escape";
      byKey.current = true;
      input.current?.blur();
    } else if (event.key === "ArrowUp" || event.key === "ArrowDown") {
      event.preventDefault();
      const size = step * (event.shiftKey ? 0.1 : 1);
      put(Number((value + (event.key === "ArrowUp" ? size : -size)).toPrecision(10)));
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
      title={wrong ? `A number from ${minimum} to ${maximum}` : undefined}
      value={draft ?? shown}
      onFocus={(event) => draft === null && event.currentTarget.select()}
      onInput={(event) => setDraft(event.currentTarget.value)}
      onBlur={() => {
        take();
        onDone?.(byKey.current);
        byKey.current = false;
      }}
      onKeyDown={key}
    />
  );
}
