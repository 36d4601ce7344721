/** A number that is typed: Enter or leaving takes it, Escape leaves it as it was, arrows step it. */
import { useEffect, useRef, useState } from "preact/hooks";
import { formatNumber, parseNumber } from "./scale";

interface Props {
  value: number;
  label: string;
  minimum: number;
  maximum: number;
  step: number;
  autoFocus?: boolean;
  onChange(value: number): void;
  onDone?(): void;
}

export function NumberField({ value, label, minimum, maximum, step, autoFocus, onChange, onDone }: Props) {
  const input = useRef<HTMLInputElement>(null);
  const [draft, setDraft] = useState<string | null>(null);
  const refused = useRef(false);
  const wrong = draft !== null && parseNumber(draft) === null;
  useEffect(() => {
    if (autoFocus) input.current?.select();
  }, [autoFocus]);

  const put = (next: number) => onChange(Math.min(maximum, Math.max(minimum, next)));
  const take = () => {
    const next = draft === null || refused.current ? null : parseNumber(draft);
    if (next !== null) put(next);
    refused.current = false;
    setDraft(null);
  };
  const key = (event: KeyboardEvent) => {
    event.stopPropagation();
    // the field is left, so that the next key is the page's again
    if (event.key === "Enter" || event.key === "Escape") {
      refused.current = event.key === "Escape";
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
      value={draft ?? formatNumber(value)}
      onFocus={(event) => event.currentTarget.select()}
      onInput={(event) => setDraft(event.currentTarget.value)}
      onBlur={() => {
        take();
        onDone?.();
      }}
      onKeyDown={key}
    />
  );
}
