/** A color: a picker and three linear components. */
import { fromHex, toHex } from "../render/color/colorMath";
import { RANGES } from "../look.gen";
import type { Rgb } from "../protocol";
import { IconButton } from "./IconButton";
import { NumberField } from "./NumberField";

export interface ColorProps {
  label: string;
  value: Rgb;
  initial: Rgb | null;
  /** True for a quantity: the picker changes its hue and keeps its magnitude; else a reflectance. */
  quantity?: boolean;
  onChange: (value: Rgb) => void;
}

const CHANNELS = ["red", "green", "blue"] as const;

export function ColorField({ label, value, initial, quantity = false, onChange }: ColorProps) {
  const minimum = quantity ? 0 : 1;
  const changed = initial !== null && value.some((v, i) => v !== initial[i]);
  return (
    <div class="color">
      <input
        type="color"
        aria-label={`${label}: picker`}
        title="Pick a color"
        value={toHex(value, minimum)}
        onInput={(event) => onChange(fromHex(event.currentTarget.value, value, minimum))}
      />
      {CHANNELS.map((name, channel) => (
        <label key={name} class={`channel ${name}`}>
          <NumberField
            label={`${label}, ${name}, linear`}
            value={value[channel] as number}
            {...RANGES.term.color}
            step={0.01}
            onChange={(next) => onChange(value.map((v, i) => (i === channel ? next : v)) as Rgb)}
          />
        </label>
      ))}
      <IconButton
        icon="reset"
        label={`Reset ${label}`}
        disabled={!changed}
        onClick={() => initial && onChange(initial)}
      />
    </div>
  );
}
