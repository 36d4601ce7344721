/** Looks as keyframes: played in the picture, gone through by hand, rendered as numbered frames or a video. */
import { passing } from "../edit/edit";
import { completed } from "../looks/compare";
import { eyeNow } from "../looks/export";
import { exporting } from "../looks/rendering";
import { shelf } from "../looks/shelf";
import { look } from "../state/look";
import { timelineOpen } from "../state/panels";
import { scene } from "../state/scene";
import { moves } from "../state/views";
import type { Look } from "../protocol";
import { IconButton } from "../ui/Button";
import { NumberField } from "../ui/NumberField";
import { RadioRow } from "../ui/RadioRow";
import { Slider } from "../ui/Slider";
import { Switch } from "../ui/Switch";
import {
  addKeyframe,
  between,
  eyeWay,
  fewestKeyframes,
  freeKeyframeName,
  keyframes,
  loops,
  MAX_KEYFRAMES,
  MAX_SECONDS,
  MIN_SECONDS,
  moveKeyframe,
  removeKeyframe,
  seconds,
  seeKeyframeFrom,
  wayNow,
  type EyeWay,
} from "../looks/keyframes";
import { exportAnimation } from "./export";
import { at, FPS, frames, keepShown, numFrames, playing, seek, togglePlay } from "./play";

const WAYS = [
  { value: "parameters", label: "Parameters", title: "From parameter to parameter; roughness evenly in its logarithm" },
  { value: "map", label: "Material map", title: "Cook–Torrance materials go across the map, through what lies between" },
] as const;

const EYE_WAYS: Record<EyeWay, string> = {
  still: "Eye stays",
  around: "Once around",
  along: "From key to key",
  object: "Object turns",
  environment: "Environment turns",
};
const OF_FIXED: EyeWay[] = ["still", "environment"];

/** What moves meanwhile. */
function EyeMeanwhile() {
  const ways = Object.entries(EYE_WAYS).filter(([way]) => moves.value || OF_FIXED.includes(way as EyeWay));
  return (
    <select
      aria-label="What moves meanwhile"
      title="The eye once around from where the first look is seen, or from where each look is seen to the next; or, before an eye that stays, the object under light that stays too, or the environment alone"
      value={wayNow.value}
      onChange={(event) => (eyeWay.value = event.currentTarget.value as EyeWay)}
    >
      {ways.map(([way, words]) => (
        <option key={way} value={way}>
          {words}
        </option>
      ))}
    </select>
  );
}

/** What is said where nothing plays yet. */
function hint(): string | null {
  const [known, missing] = [keyframes.value.length, fewestKeyframes.value - keyframes.value.length];
  if (missing === 2) return "Add two looks to see what lies between them, or one and what turns.";
  if (missing === 1) return known === 0 ? "Add a look." : "Add one more look, or choose what turns.";
  return frames.value === null ? "Finding what lies between…" : null;
}

function Transport() {
  const ready = frames.value !== null;
  const last = Math.max(1, keyframes.value.length - 1);
  return (
    <div class="timeline-transport">
      <IconButton
        icon={playing.value ? "pause" : "play"}
        label={playing.value ? "Pause" : "Play"}
        keys="K"
        disabled={!ready}
        onClick={togglePlay}
      />
      <div class="timeline-way">
        <Slider
          label="Time"
          minimum={0}
          maximum={seconds.value}
          scale="linear"
          step={1 / FPS}
          unit="s"
          value={at.value * seconds.value}
          onChange={(second) => {
            playing.value = false;
            seek(second / seconds.value);
          }}
        />
        {ready && (
          <div class="timeline-marks" aria-hidden="true">
            {keyframes.value.map(({ name }, index) => (
              <span key={`${index} ${name}`} style={{ left: `${(100 * index) / last}%` }} />
            ))}
          </div>
        )}
      </div>
      <label class="timeline-seconds">
        <NumberField
          label="Seconds in all"
          value={seconds.value}
          minimum={MIN_SECONDS}
          maximum={MAX_SECONDS}
          step={0.5}
          onChange={(value) => (seconds.value = value)}
        />
        s in all
      </label>
      <Switch icon="loop" label="Again from the beginning" of={loops} />
      <EyeMeanwhile />
    </div>
  );
}

function KeyframeTile({ index, name }: { index: number; name: string }) {
  const last = keyframes.value.length - 1;
  return (
    <li class="keyframe">
      <button
        title={`Go to ${name}`}
        disabled={frames.value === null}
        onClick={() => {
          playing.value = false;
          seek(index / Math.max(1, last));
        }}
      >
        {name}
      </button>
      {moves.value && (
        <IconButton
          icon="eye"
          label={`See ${name} from where the eye is now`}
          onClick={() => {
            const eye = eyeNow();
            if (eye !== null) seeKeyframeFrom(index, eye);
          }}
        />
      )}
      <IconButton icon="earlier" label={`${name} earlier`} disabled={index === 0} onClick={() => moveKeyframe(index, -1)} />
      <IconButton icon="later" label={`${name} later`} disabled={index === last} onClick={() => moveKeyframe(index, 1)} />
      <IconButton icon="close" label={`Take ${name} off`} onClick={() => removeKeyframe(index)} />
    </li>
  );
}

/** What can be put onto the time line, by the value of its option. */
function choices(): Map<string, { name: string; look: Partial<Look> }> {
  const variants = (scene.value?.variants ?? []).map(({ name, look: of }) => ({ name, look: of as Partial<Look> }));
  return new Map([...shelf.value, ...variants].map((of, k) => [`${k}`, of]));
}

function AddKeyframe() {
  const known = choices();
  const add = (chosen: string) => {
    const live = look.peek();
    if (chosen === "live" && live !== null) addKeyframe({ name: freeKeyframeName(), look: live, eye: eyeNow() });
    const saved = known.get(chosen);
    if (saved !== undefined) addKeyframe({ name: saved.name, look: completed(saved.look), eye: eyeNow() });
  };
  return (
    <select
      aria-label="Add a look to the time line"
      value=""
      disabled={keyframes.value.length >= MAX_KEYFRAMES || look.value === null}
      onChange={(event) => {
        add(event.currentTarget.value);
        event.currentTarget.value = "";
      }}
    >
      <option value="">Add a look…</option>
      <option value="live">The live look</option>
      {[...known].map(([value, { name }]) => (
        <option key={value} value={value}>
          {name}
        </option>
      ))}
    </select>
  );
}

function Render() {
  const busy = exporting.value !== null || frames.value === null;
  const count = numFrames.value;
  return (
    <select
      aria-label="Render the time line"
      value=""
      disabled={busy}
      onChange={(event) => {
        const [format, how] = event.currentTarget.value.split(" ");
        event.currentTarget.value = "";
        void exportAnimation(format as "png" | "mp4", how === "exact");
      }}
    >
      <option value="">Render…</option>
      {moves.value && <option value="mp4 quick">Video, quick, {count} frames</option>}
      <option value="mp4 exact">Video{moves.value ? ", exact" : ""}, {count} frames at {FPS} a second</option>
      {moves.value && <option value="png quick">Numbered PNG, quick, in a ZIP</option>}
      <option value="png exact">Numbered PNG{moves.value ? ", exact" : ""}, in a ZIP</option>
    </select>
  );
}

/** By itself: what is shown in passing changes with every frame. */
function Keep() {
  return (
    <button disabled={passing.value === null} title="Go on with the look that is shown, as one step" onClick={keepShown}>
      Keep this look
    </button>
  );
}

export function Timeline() {
  const said = hint();
  return (
    <section class="timeline" aria-label="Time line">
      <Transport />
      <div class="timeline-keys">
        <ol aria-label="Looks on the time line">
          {keyframes.value.map(({ name }, index) => (
            <KeyframeTile key={`${index} ${name}`} index={index} name={name} />
          ))}
        </ol>
        <AddKeyframe />
        <span class="timeline-hint" role="status">
          {said}
        </span>
        <RadioRow label="Between looks" choices={WAYS} chosen={between.value} onChoose={(way) => (between.value = way)} />
        <Render />
        <Keep />
        <IconButton icon="close" label="Close the time line; the look is as it was" onClick={() => (timelineOpen.value = false)} />
      </div>
    </section>
  );
}
