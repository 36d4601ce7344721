/** A slider: drag or click, arrow and Page keys, Shift for fine steps, double-click to type, modifier-click to reset.
 * Digits start typing. Fill and thumb move by transforms, so that nothing is repainted during a drag. */
import { useRef, useState } from "preact/hooks";
import { NumberField } from "./NumberField";
import { useDrag } from "./drag";
import { formatNumber, fromFraction, keyStep, parseNumber, snap, toFraction, type NumberRange } from "./scale";
import { parseFactor } from "./stops";

export interface SliderProps extends NumberRange {
  label: string;
  value: number;
  /** Factors, "×", may be typed in stops. */
  unit?: string;
  initial?: number;
  tint?: string;
  onChange: (value: number) => void;
  /** Called when a drag starts, before the slider moves. */
  onHold?: () => void;
}

const FINE = 0.1;
const STEPS: Record<string, number> = {
  ArrowLeft: -1,
  ArrowDown: -1,
  ArrowRight: 1,
  ArrowUp: 1,
  PageDown: -10,
  PageUp: 10,
};

/** True if a key starts a typed number. */
function isNumberKey(event: KeyboardEvent, isSigned: boolean): boolean {
  if (event.ctrlKey || event.metaKey || event.altKey) return false;
  return /^[0-9.,]$/.test(event.key) || (event.key === "-" && isSigned);
}

export function Slider(props: SliderProps) {
  const { label, value, unit = "", initial, tint, onChange } = props;
  const drag = useRef({ x: 0, at: 0, width: 1 });
  const [typing, setTyping] = useState<{ initialText?: string } | null>(null);
  const track = useRef<HTMLDivElement>(null);
  const fraction = toFraction(props, value);
  const isFactor = unit === "×";

  const set = (fraction: number) => {
    drag.current.at = Math.min(1, Math.max(0, fraction));
    onChange(fromFraction(props, fraction));
  };
  const dragHandlers = useDrag({
    begin(event) {
      if (event.button !== 0) return false;
      props.onHold?.();
      if ((event.ctrlKey || event.altKey || event.metaKey) && initial !== undefined) {
        onChange(initial);
        return false;
      }
      const box = event.currentTarget.getBoundingClientRect();
      const clicked = (event.clientX - box.left) / box.width;
      drag.current = { x: event.clientX, at: fraction, width: box.width };
      if (Math.abs(clicked - fraction) * box.width > 7) set(clicked);
      return true;
    },
    move(event) {
      const dx = (event.clientX - drag.current.x) / drag.current.width;
      drag.current.x = event.clientX;
      if (dx !== 0) set(drag.current.at + dx * (event.shiftKey ? FINE : 1));
    },
  });
  /** Several keys may be pressed before the field opens. */
  const begin = (typed: string) => setTyping((now) => ({ initialText: `${now?.initialText ?? ""}${typed}` }));
  const key = (event: KeyboardEvent) => {
    const step = STEPS[event.key];
    if (step !== undefined)
      set(fraction + step * keyStep(props) * (event.shiftKey && props.step === undefined ? FINE : 1));
    else if (event.key === "Home") set(0);
    else if (event.key === "End") set(1);
    else if (event.key === "Enter") setTyping({});
    else if (isNumberKey(event, isFactor || props.minimum < 0)) begin(event.key);
    else if ((event.key === "Delete" || event.key === "Backspace") && initial !== undefined) onChange(initial);
    else return;
    event.preventDefault();
    event.stopPropagation();
  };
  const valueText = `${props.step === 1 ? value : formatNumber(value)}${unit === "" ? "" : ` ${unit}`}`;
  return (
    <div class="slider">
      <div
        ref={track}
        class="track"
        role="slider"
        tabIndex={0}
        aria-label={label}
        aria-valuemin={props.minimum}
        aria-valuemax={props.maximum}
        aria-valuenow={value}
        aria-valuetext={valueText}
        style={tint === undefined ? undefined : { "--tint": tint }}
        onFocus={props.onHold}
        {...dragHandlers}
        onKeyDown={key}
        onDblClick={() => setTyping({})}
      >
        <span class="fill" style={{ transform: `scaleX(${fraction.toFixed(4)})` }} />
        <span class="fill-track" style={{ transform: `translateX(${(100 * fraction).toFixed(2)}%)` }}>
          <span class="thumb" />
        </span>
        {initial !== undefined && <span class="initial" style={{ left: `${toFraction(props, initial) * 100}%` }} />}
      </div>
      {typing !== null ? (
        <NumberField
          value={value}
          label={`${label} value`}
          minimum={props.minimum}
          maximum={props.maximum}
          step={props.step ?? (props.maximum - props.minimum) / 100}
          parse={isFactor ? parseFactor : parseNumber}
          autoFocus
          {...typing}
          onChange={(next) => onChange(snap(props, next))}
          onDone={(isKeyboard) => {
            setTyping(null);
            if (isKeyboard) track.current?.focus();
          }}
        />
      ) : (
        <button
          type="button"
          class="value"
          title={isFactor ? "Type a value, or stops: +1 EV" : "Type a value"}
          aria-label={`${label}: ${valueText}; type a value`}
          onClick={() => setTyping({})}
        >
          {valueText}
        </button>
      )}
    </div>
  );
}
