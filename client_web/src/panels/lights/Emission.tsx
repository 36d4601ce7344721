/** A light's emission: color as numbers and temperature, power in watts and lumens. */
import { beginDrag } from "../../session/prepare";
import type { Light } from "../../protocol";
import { defaultLook } from "../../state/look";
import { ColorField } from "../../ui/ColorField";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { NumberField } from "../../ui/NumberField";
import { UNITS } from "./lightKinds";
import { editLight, lightPath } from "./lightEdits";
import { emissionForWatts, LUMENS_PER_WATT, unitsOf, wattsOf } from "./power";
import { withKelvin, MIN_KELVIN, MAX_KELVIN, kelvinOf } from "./temperature";

interface Props {
  name: string;
  light: Light;
}

const MOST_WATTS = 1e13;

function Power({ name, light }: Props) {
  const { label, watts, lumens } = unitsOf(light);
  const currentWatts = wattsOf(light);
  const setWatts = (label: string, next: number) => {
    const emission = emissionForWatts(light, next);
    if (emission !== null) editLight(label, name, "emission", emission);
  };
  const fields = [
    { unit: watts, size: 1 },
    { unit: lumens, size: LUMENS_PER_WATT },
  ];
  return (
    <div class="numbers" role="group" aria-label={label} style={{ "--count": 2 }}>
      <span class="param-label">{label}</span>
      {fields.map(({ unit, size }) => (
        <label key={unit}>
          <NumberField
            label={`${label}, ${unit}`}
            value={currentWatts * size}
            minimum={0}
            maximum={MOST_WATTS * size}
            step={Math.max(currentWatts * size * 0.1, 1e-3)}
            onChange={(next) => setWatts(label, next / size)}
          />
          <small>{unit}</small>
        </label>
      ))}
    </div>
  );
}

function Temperature({ name, light }: Props) {
  const { kelvin, isColored } = kelvinOf(light.emission);
  return (
    <LabeledSlider
      label="Color temperature"
      shortLabel={isColored ? "Color temperature (nearest to this color)" : "Color temperature"}
      title="Candle 1,900 K, bulb 2,700 K, daylight 6,500 K. Brightness is kept."
      value={kelvin}
      minimum={MIN_KELVIN}
      maximum={MAX_KELVIN}
      scale="log"
      step={1}
      unit="K"
      onChange={(next) => editLight("Color temperature", name, "emission", withKelvin(light.emission, next))}
      onHold={() => beginDrag(lightPath(name))}
    />
  );
}

export function Emission({ name, light }: Props) {
  return (
    <>
      <span class="param-label">
        Emission <small>{UNITS[light.kind]}</small>
      </span>
      <ColorField
        label="Emission"
        quantity
        value={light.emission}
        initial={defaultLook.value?.lights[name]?.emission ?? null}
        onChange={(value) => editLight("Emission", name, "emission", value)}
      />
      <Temperature name={name} light={light} />
      <Power name={name} light={light} />
    </>
  );
}
