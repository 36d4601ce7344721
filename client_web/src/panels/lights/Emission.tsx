/** A light's emission: color as numbers and temperature; power and luminance in watts and lumens; intensity in stops. */
import { beginDrag } from "../../session/prepare";
import { RANGES } from "../../look.gen";
import type { Light } from "../../protocol";
import { defaultLook } from "../../state/look";
import { ColorField } from "../../ui/ColorField";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { NumberField } from "../../ui/NumberField";
import { factorOf, stopsOf } from "../../ui/stops";
import { UNITS } from "./lightKinds";
import { editLight, lightPath } from "./lightEdits";
import { emissionForWatts, LUMENS_PER_WATT, quantitiesOf, wattsOf, type Quantity } from "./power";
import { withKelvin, MIN_KELVIN, MAX_KELVIN, kelvinOf } from "./temperature";

interface Props {
  name: string;
  light: Light;
}

const MOST_WATTS = 1e13;
const MAX_INTENSITY = RANGES.light.intensity.maximum;
const MIN_STOPS = -20; // about a millionth

function Brightness({ name, light, quantity }: Props & { quantity: Quantity }) {
  const { label, watts, lumens, perWatt } = quantity;
  const currentWatts = wattsOf(light);
  const setWatts = (label: string, next: number) => {
    const emission = emissionForWatts(light, next);
    if (emission !== null) editLight(label, name, "emission", emission);
  };
  const fields = [
    { unit: watts, size: perWatt },
    { unit: lumens, size: perWatt * LUMENS_PER_WATT },
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

function Intensity({ name, light }: Props) {
  const setIntensity = (next: number) => editLight("Intensity", name, "intensity", next);
  return (
    <div class="numbers" role="group" aria-label="Intensity" style={{ "--count": 2 }}>
      <span class="param-label">Intensity</span>
      <label>
        <NumberField
          label="Intensity, factor"
          value={light.intensity}
          minimum={0}
          maximum={MAX_INTENSITY}
          step={Math.max(light.intensity * 0.1, 1e-3)}
          onChange={setIntensity}
        />
        <small>×</small>
      </label>
      <label>
        <NumberField
          label="Intensity, EV"
          value={stopsOf(light.intensity)}
          minimum={MIN_STOPS}
          maximum={stopsOf(MAX_INTENSITY)}
          step={1 / 3}
          onChange={(next) => setIntensity(factorOf(next))}
        />
        <small>EV</small>
      </label>
    </div>
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
      {quantitiesOf(light).map((quantity) => (
        <Brightness key={quantity.label} name={name} light={light} quantity={quantity} />
      ))}
      <Intensity name={name} light={light} />
    </>
  );
}
