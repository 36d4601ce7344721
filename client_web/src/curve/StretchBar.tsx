/** The selected stretch by numbers and buttons: the click way to what dragging does. */
import { NumberField } from "../ui/NumberField";
import { applyScale, applyShift, selection, type Hand } from "./tools";

export function StretchBar({ hand }: { hand: Hand }) {
  const [from, to] = selection.value ?? [0, 10];
  const shift = (degrees: number) => (selection.value = applyShift(hand, [from, to], degrees));
  return (
    <div class="stretch-bar">
      <label>
        from{" "}
        <NumberField
          label="Stretch from, degrees"
          value={from}
          minimum={0}
          maximum={to}
          step={0.5}
          onChange={(x) => (selection.value = [x, to])}
        />
      </label>
      <label>
        to
        <NumberField
          label="Stretch to, degrees"
          value={to}
          minimum={from}
          maximum={90}
          step={0.5}
          onChange={(x) => (selection.value = [from, x])}
        />
      </label>
      <span class="spacer" />
      <button title="Shift by −1°" onClick={() => shift(-1)}>
        ◂
      </button>
      <button title="Shift by +1°" onClick={() => shift(1)}>
        ▸
      </button>
      <button title="Scale by 0.9" onClick={() => applyScale(hand, [from, to], 0.9)}>
        ×0.9
      </button>
      <button title="Scale by 1.1" onClick={() => applyScale(hand, [from, to], 1.1)}>
        ×1.1
      </button>
    </div>
  );
}
