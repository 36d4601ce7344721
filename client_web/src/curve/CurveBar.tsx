/** Controls of the curve editor: tools and channels above the plot, axes and reset below it. */
import { inspectorWidth } from "../state/panels";
import { IconButton } from "../ui/IconButton";
import type { IconName } from "../ui/Icon";
import { ToggleButton } from "../ui/ToggleButton";
import { CHANNELS, type ActiveChannels } from "./model/channels";
import { copyCurve, applyChannels } from "./model/model";
import {
  activeChannels,
  isStretched,
  isIntervalLit,
  logarithmic,
  stretchedCurves,
  tableOpen,
  curveTool,
  type Tool,
} from "./curveView";
import type { CurveContext } from "./curveTools";

const TOOLS: { name: Tool; icon: IconName; label: string; keys: string }[] = [
  { name: "points", icon: "points", label: "Points", keys: "P" },
  { name: "draw", icon: "draw", label: "Draw", keys: "D" },
  { name: "stretch", icon: "stretch", label: "Scale and move a range", keys: "T" },
];
const ACTIVE: ActiveChannels[] = ["rgb", ...CHANNELS];
const WIDE_TITLE = 560;
const NARROW_TITLE = 320;

export function CurveTools({ context }: { context: CurveContext }) {
  return (
    <div class="bar">
      <div class="group" role="group" aria-label="Tool">
        {TOOLS.map(({ name, icon, label, keys }) => (
          <IconButton
            key={name}
            icon={icon}
            label={label}
            keys={keys}
            pressed={curveTool.value === name}
            onClick={() => (curveTool.value = name)}
          />
        ))}
      </div>
      <div class="group" role="group" aria-label="Channels">
        {ACTIVE.map((name) => (
          <button
            key={name}
            class={`channel-switch ${name}`}
            aria-pressed={activeChannels.value === name}
            onClick={() => (activeChannels.value = name)}
          >
            {name.toUpperCase()}
          </button>
        ))}
      </div>
      {!context.model.areJoined && activeChannels.value === "rgb" && (
        <button
          onClick={() =>
            applyChannels(context.model, "Link channels", () => copyCurve(context.model, 1, context.axes), [0, 1, 2])
          }
          title="Use the green curve for all channels"
        >
          Link
        </button>
      )}
      <span class="spacer" />
      <IconButton
        icon="wide"
        label={inspectorWidth.value >= WIDE_TITLE ? "Narrow the inspector" : "Widen the inspector"}
        pressed={inspectorWidth.value >= WIDE_TITLE}
        onClick={() => (inspectorWidth.value = inspectorWidth.value >= WIDE_TITLE ? NARROW_TITLE : WIDE_TITLE)}
      />
    </div>
  );
}

export function CurveBar({ context }: { context: CurveContext }) {
  const { info, channels } = context.model;
  const isStretchedAxis = isStretched(info.name, info.bands);
  const drawn = context.channels.some((c) => channels[c] !== null);
  return (
    <div class="bar">
      <button
        aria-pressed={isStretchedAxis}
        title="Zoom highlights: more room for angles near 0°"
        onClick={() => (stretchedCurves.value = { ...stretchedCurves.value, [info.name]: !isStretchedAxis })}
      >
        0°↔
      </button>
      <button
        aria-pressed={logarithmic.value}
        title="Logarithmic scale (L)"
        onClick={() => (logarithmic.value = !logarithmic.value)}
      >
        log
      </button>
      <ToggleButton icon="view" label="Tint pixels lit by the curve under the pointer" state={isIntervalLit} />
      <IconButton
        icon="table"
        label="Point table"
        pressed={tableOpen.value}
        onClick={() => {
          tableOpen.value = !tableOpen.value;
          if (tableOpen.value) curveTool.value = "points";
        }}
      />
      <span class="spacer" />
      <IconButton
        icon="reset"
        label="Reset to the model's curve"
        disabled={!drawn}
        onClick={() => applyChannels(context.model, "Reset curve", () => null, context.channels)}
      >
        Reset
      </IconButton>
    </div>
  );
}
