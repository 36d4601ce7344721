/** The curve editor's switches: tools and channels above the plot, axes and resets below it. */
import { inspectorWidth } from "../state/panels";
import { IconButton } from "../ui/Button";
import type { IconName } from "../ui/Icon";
import { Switch } from "../ui/Switch";
import { CHANNELS, type Active } from "./model/channels";
import { copyOf, put } from "./model/model";
import { active, isStretched, lights, logarithmic, stretched, tableOpen, tool, type Tool } from "./settings";
import type { Hand } from "./tools";

const TOOLS: { name: Tool; icon: IconName; label: string; keys: string }[] = [
  { name: "points", icon: "points", label: "Points", keys: "P" },
  { name: "draw", icon: "draw", label: "Draw", keys: "D" },
  { name: "stretch", icon: "stretch", label: "Scale and shift a stretch", keys: "T" },
];
const ACTIVE: Active[] = ["rgb", ...CHANNELS];
const WIDE = 560;
const NARROW = 320;

export function CurveTools({ hand }: { hand: Hand }) {
  return (
    <div class="bar">
      <div class="group" role="group" aria-label="Tool">
        {TOOLS.map(({ name, icon, label, keys }) => (
          <IconButton
            key={name}
            icon={icon}
            label={label}
            keys={keys}
            pressed={tool.value === name}
            onClick={() => (tool.value = name)}
          />
        ))}
      </div>
      <div class="group" role="group" aria-label="Channels">
        {ACTIVE.map((name) => (
          <button
            key={name}
            class={`channel-switch ${name}`}
            aria-pressed={active.value === name}
            onClick={() => (active.value = name)}
          >
            {name.toUpperCase()}
          </button>
        ))}
      </div>
      {!hand.model.together && active.value === "rgb" && (
        <button
          onClick={() => put(hand.model, "Join channels", () => copyOf(hand.model, 1, hand.axes), [0, 1, 2])}
          title="Give all three channels the green curve"
        >
          Join
        </button>
      )}
      <span class="spacer" />
      <IconButton
        icon="wide"
        label={inspectorWidth.value >= WIDE ? "Narrow the inspector" : "Widen the inspector"}
        pressed={inspectorWidth.value >= WIDE}
        onClick={() => (inspectorWidth.value = inspectorWidth.value >= WIDE ? NARROW : WIDE)}
      />
    </div>
  );
}

export function CurveBar({ hand }: { hand: Hand }) {
  const { info, channels } = hand.model;
  const near = isStretched(info.name, info.bands);
  const drawn = hand.channels.some((c) => channels[c] !== null);
  return (
    <div class="bar">
      <button
        aria-pressed={near}
        title="Stretch the angles near 0°, where highlights live"
        onClick={() => (stretched.value = { ...stretched.value, [info.name]: !near })}
      >
        0°↔
      </button>
      <button
        aria-pressed={logarithmic.value}
        title="Logarithmic values (L)"
        onClick={() => (logarithmic.value = !logarithmic.value)}
      >
        log
      </button>
      <Switch icon="eye" label="Pointing at the curve tints the pixels it lights" of={lights} />
      <IconButton
        icon="table"
        label="Points as numbers"
        pressed={tableOpen.value}
        onClick={() => {
          tableOpen.value = !tableOpen.value;
          if (tableOpen.value) tool.value = "points";
        }}
      />
      <span class="spacer" />
      <IconButton
        icon="reset"
        label="Back to the model's own curve"
        disabled={!drawn}
        onClick={() => put(hand.model, "Reset curve", () => null, hand.channels)}
      >
        Reset
      </IconButton>
    </div>
  );
}
