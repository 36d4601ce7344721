/** What a light sends out: its colour as numbers and as a temperature, its whole in watts and in lumens. */
import { hold } from "../live/touch";
import type { Light, Rgb } from "../protocol";
import { defaultLook } from "../state/look";
import { ColorField } from "../ui/ColorField";
import { LabelledSlider } from "../ui/LabelledSlider";
import { NumberField } from "../ui/NumberField";
import { UNITS } from "./kinds";
import { editLight, lightPath } from "./lights";
import { emissionOf, LUMENS_A_WATT, measureOf, wattsOf } from "./power";
import { atKelvin, COOLEST, HOTTEST, kelvinOf } from "./temperature";

interface Props {
  name: string;
  light: Light;
}

const MOST_WATTS = 1e9;

function Power({ name, light }: Props) {
  const { label, watts, lumens } = measureOf(light);
  const now = wattsOf(light);
  const put = (deed: string, next: number) => {
    const emission = emissionOf(light, next);
    if (emission !== null) editLight(deed, name, "emission", emission);
  };
  const fields = [
    { unit: watts, size: 1 },
    { unit: lumens, size: LUMENS_A_WATT },
  ];
  return (
    <div class="numbers" role="group" aria-label={label} style={{ "--count": 2 }}>
      <span class="param-label">{label}</span>
      {fields.map(({ unit, size }) => (
        <label key={unit}>
          <NumberField
            label={`${label}, ${unit}`}
            value={now * size}
            minimum={0}
            maximum={MOST_WATTS * size}
            step={Math.max(now * size * 0.1, 1e-3)}
            onChange={(next) => put(label, next / size)}
          />
          <small>{unit}</small>
        </label>
      ))}
    </div>
  );
}

function Temperature({ name, light }: Props) {
  const { kelvin, coloured } = kelvinOf(light.emission);
  return (
    <LabelledSlider
      label="Temperature"
      shown={coloured ? "Temperature (now coloured; this is the nearest)" : "Temperature"}
      title="The colour of a glowing body: a candle 1,900 K, a bulb 2,700 K, daylight 6,500 K. It stays as bright as it is."
      value={kelvin}
      minimum={COOLEST}
      maximum={HOTTEST}
      scale="log"
      step={1}
      unit="K"
      onChange={(next) => editLight("Temperature", name, "emission", atKelvin(light.emission, next))}
      onHold={() => hold(lightPath(name))}
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
        initial={(defaultLook.value?.lights[name]?.emission as Rgb | undefined) ?? null}
        onChange={(value) => editLight("Emission", name, "emission", value)}
      />
      <Temperature name={name} light={light} />
      <Power name={name} light={light} />
    </>
  );
}
