/** Numeric fields and buttons for the selected interval, as an alternative to dragging. */
import { NumberField } from "../ui/NumberField";
import { applyScale, applyShift, selectedInterval, type CurveContext } from "./curveTools";

export function IntervalBar({ context }: { context: CurveContext }) {
  const [from, to] = selectedInterval.value ?? [0, 10];
  const shift = (degrees: number) => (selectedInterval.value = applyShift(context, [from, to], degrees));
  return (
    <div class="stretch-bar">
      <label>
        from{" "}
        <NumberField
          label="Range start, degrees"
          value={from}
          minimum={0}
          maximum={to}
          step={0.5}
          onChange={(x) => (selectedInterval.value = [x, to])}
        />
      </label>
      <label>
        to
        <NumberField
          label="Range end, degrees"
          value={to}
          minimum={from}
          maximum={90}
          step={0.5}
          onChange={(x) => (selectedInterval.value = [from, x])}
        />
      </label>
      <span class="spacer" />
      <button title="Move by −1°" onClick={() => shift(-1)}>
        ◂
      </button>
      <button title="Move by +1°" onClick={() => shift(1)}>
        ▸
      </button>
      <button title="Scale by 0.9" onClick={() => applyScale(context, [from, to], 0.9)}>
        ×0.9
      </button>
      <button title="Scale by 1.1" onClick={() => applyScale(context, [from, to], 1.1)}>
        ×1.1
      </button>
    </div>
  );
}
