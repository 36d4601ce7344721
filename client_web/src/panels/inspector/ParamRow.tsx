/** One parameter: one slider, or three for separate red, green and blue values. */
import type { ParameterBody, ParamValue, Rgb } from "../../protocol";
import { IconButton } from "../../ui/IconButton";
import { Slider } from "../../ui/Slider";

const CHANNELS = [
  { name: "red", tint: "var(--red)" },
  { name: "green", tint: "var(--green)" },
  { name: "blue", tint: "var(--blue)" },
] as const;

interface Props {
  info: ParameterBody;
  value: ParamValue;
  initial: ParamValue;
  onChange: (value: ParamValue) => void;
  onHold: () => void;
}

function meanOf(value: ParamValue): number {
  return typeof value === "number" ? value : (value[0] + value[1] + value[2]) / 3;
}

export function ParamRow({ info, value, initial, onChange, onHold }: Props) {
  const channelsDiffer = typeof value !== "number";
  const range = { minimum: info.minimum, maximum: info.maximum, scale: info.scale, unit: info.unit, ...(info.step === null ? {} : { step: info.step }) };
  const toggle = () => onChange(channelsDiffer ? meanOf(value) : [value, value, value]);
  const link = (
    <IconButton
      icon={channelsDiffer ? "unlink" : "link"}
      label={
        channelsDiffer ? `${info.label}: link red, green and blue` : `${info.label}: separate red, green and blue`
      }
      pressed={channelsDiffer}
      onClick={toggle}
    />
  );
  return (
    <div class={`param ${channelsDiffer ? "by-channel" : ""}`}>
      <span class="param-label" title={info.help}>
        {info.label}
      </span>
      {channelsDiffer ? (
        <div class="channels">
          {CHANNELS.map(({ name, tint }, channel) => (
            <Slider
              key={name}
              {...range}
              label={`${info.label}, ${name}`}
              tint={tint}
              value={value[channel] as number}
              initial={typeof initial === "number" ? initial : (initial[channel] as number)}
              onChange={(next) => onChange(value.map((v, i) => (i === channel ? next : v)) as Rgb)}
              onHold={onHold}
            />
          ))}
        </div>
      ) : (
        <Slider {...range} label={info.label} value={value} initial={meanOf(initial)} onChange={onChange} onHold={onHold} />
      )}
      {info.requires_new_operator ? null : link}
    </div>
  );
}
