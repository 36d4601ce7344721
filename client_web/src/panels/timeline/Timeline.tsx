/** Looks as keyframes: played in the image, scrubbed, rendered as numbered frames or a video. */
import { previewedStep } from "../../edit/edit";
import { completeLook } from "../looks/abCompare";
import { currentPose } from "../looks/exportImage";
import { exporting } from "../looks/renderJob";
import { savedLooks } from "../looks/savedLooks";
import { look } from "../../state/look";
import { timelineOpen } from "../../state/panels";
import { scene } from "../../state/scene";
import { hasFreeCamera } from "../../state/views";
import type { Look } from "../../protocol";
import { IconButton } from "../../ui/IconButton";
import { NumberField } from "../../ui/NumberField";
import { RadioRow } from "../../ui/RadioRow";
import { Slider } from "../../ui/Slider";
import { ToggleButton } from "../../ui/ToggleButton";
import {
  addKeyframe,
  interpolation,
  cameraPathMode,
  fewestKeyframes,
  nextKeyframeName,
  keyframes,
  isLooping,
  MAX_KEYFRAMES,
  MAX_SECONDS,
  MIN_SECONDS,
  moveKeyframe,
  removeKeyframe,
  seconds,
  setKeyframeCamera,
  currentPath,
  type CameraPathMode,
} from "../looks/keyframes";
import { exportAnimation } from "./exportTimeline";
import { playhead, FPS, frameLookList, commitShownLook, numFrames, isPlaying, seek, togglePlay } from "./playback";

const INTERPOLATIONS = [
  { value: "parameters", label: "Parameters", title: "From parameter to parameter; roughness evenly in its logarithm" },
  { value: "map", label: "Material map", title: "Cook–Torrance materials go across the map, through what lies between" },
] as const;

const MOTION_LABELS: Record<CameraPathMode, string> = {
  still: "Eye stays",
  around: "Once around",
  along: "From key to key",
  object: "Object turns",
  environment: "Environment turns",
};
const FIXED_CAMERA_MOTIONS: CameraPathMode[] = ["still", "environment"];

/** What moves meanwhile. */
function MotionSelect() {
  const options = Object.entries(MOTION_LABELS).filter(([mode]) => hasFreeCamera.value || FIXED_CAMERA_MOTIONS.includes(mode as CameraPathMode));
  return (
    <select
      aria-label="What moves meanwhile"
      title="The eye once around from where the first look is seen, or from where each look is seen to the next; or, before an eye that stays, the object under light that stays too, or the environment alone"
      value={currentPath.value}
      onChange={(event) => (cameraPathMode.value = event.currentTarget.value as CameraPathMode)}
    >
      {options.map(([mode, label]) => (
        <option key={mode} value={mode}>
          {label}
        </option>
      ))}
    </select>
  );
}

/** The hint while nothing plays yet. */
function keyframeHint(): string | null {
  const [numKeyframes, missing] = [keyframes.value.length, fewestKeyframes.value - keyframes.value.length];
  if (missing === 2) return "Add two looks to see what lies between them, or one and what turns.";
  if (missing === 1) return numKeyframes === 0 ? "Add a look." : "Add one more look, or choose what turns.";
  return frameLookList.value === null ? "Finding what lies between…" : null;
}

function PlaybackControls() {
  const ready = frameLookList.value !== null;
  const last = Math.max(1, keyframes.value.length - 1);
  return (
    <div class="timeline-transport">
      <IconButton
        icon={isPlaying.value ? "pause" : "play"}
        label={isPlaying.value ? "Pause" : "Play"}
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
          value={playhead.value * seconds.value}
          onChange={(second) => {
            isPlaying.value = false;
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
      <ToggleButton icon="loop" label="Again from the beginning" state={isLooping} />
      <MotionSelect />
    </div>
  );
}

function KeyframeTile({ index, name }: { index: number; name: string }) {
  const last = keyframes.value.length - 1;
  return (
    <li class="keyframe">
      <button
        title={`Go to ${name}`}
        disabled={frameLookList.value === null}
        onClick={() => {
          isPlaying.value = false;
          seek(index / Math.max(1, last));
        }}
      >
        {name}
      </button>
      {hasFreeCamera.value && (
        <IconButton
          icon="eye"
          label={`See ${name} from where the eye is now`}
          onClick={() => {
            const camera = currentPose();
            if (camera !== null) setKeyframeCamera(index, camera);
          }}
        />
      )}
      <IconButton icon="earlier" label={`${name} earlier`} disabled={index === 0} onClick={() => moveKeyframe(index, -1)} />
      <IconButton icon="later" label={`${name} later`} disabled={index === last} onClick={() => moveKeyframe(index, 1)} />
      <IconButton icon="close" label={`Take ${name} off`} onClick={() => removeKeyframe(index)} />
    </li>
  );
}

/** Looks that can be added to the timeline, by the value of their option. */
function lookChoices(): Map<string, { name: string; look: Partial<Look> }> {
  const variants = (scene.value?.variants ?? []).map(({ name, look: namedLook }) => ({ name, look: namedLook as Partial<Look> }));
  return new Map([...savedLooks.value, ...variants].map((partialLook, k) => [`${k}`, partialLook]));
}

function AddKeyframe() {
  const lookChoiceMap = lookChoices();
  const addChoice = (choiceKey: string) => {
    const live = look.peek();
    if (choiceKey === "live" && live !== null) addKeyframe({ name: nextKeyframeName(), look: live, camera: currentPose() });
    const saved = lookChoiceMap.get(choiceKey);
    if (saved !== undefined) addKeyframe({ name: saved.name, look: completeLook(saved.look), camera: currentPose() });
  };
  return (
    <select
      aria-label="Add a look to the time line"
      value=""
      disabled={keyframes.value.length >= MAX_KEYFRAMES || look.value === null}
      onChange={(event) => {
        addChoice(event.currentTarget.value);
        event.currentTarget.value = "";
      }}
    >
      <option value="">Add a look…</option>
      <option value="live">The live look</option>
      {[...lookChoiceMap].map(([value, { name }]) => (
        <option key={value} value={value}>
          {name}
        </option>
      ))}
    </select>
  );
}

function RenderSelect() {
  const busy = exporting.value !== null || frameLookList.value === null;
  const count = numFrames.value;
  return (
    <select
      aria-label="Render the time line"
      value=""
      disabled={busy}
      onChange={(event) => {
        const [format, how] = event.currentTarget.value.split(" ");
        event.currentTarget.value = "";
        void exportAnimation(format as "png" | "mp4", how === "exact" ? "exact" : "interactive");
      }}
    >
      <option value="">Render…</option>
      {hasFreeCamera.value && <option value="mp4 quick">Video, quick, {count} frames</option>}
      <option value="mp4 exact">Video{hasFreeCamera.value ? ", exact" : ""}, {count} frames at {FPS} a second</option>
      {hasFreeCamera.value && <option value="png quick">Numbered PNG, quick, in a ZIP</option>}
      <option value="png exact">Numbered PNG{hasFreeCamera.value ? ", exact" : ""}, in a ZIP</option>
    </select>
  );
}

/** By itself: what is shown in passing changes with every frame. */
function KeepLookButton() {
  return (
    <button disabled={previewedStep.value === null} title="Go on with the look that is shown, as one step" onClick={commitShownLook}>
      Keep this look
    </button>
  );
}

export function Timeline() {
  const hintText = keyframeHint();
  return (
    <section class="timeline" aria-label="Time line">
      <PlaybackControls />
      <div class="timeline-keys">
        <ol aria-label="Looks on the time line">
          {keyframes.value.map(({ name }, index) => (
            <KeyframeTile key={`${index} ${name}`} index={index} name={name} />
          ))}
        </ol>
        <AddKeyframe />
        <span class="timeline-hint" role="status">
          {hintText}
        </span>
        <RadioRow label="Between looks" choices={INTERPOLATIONS} selected={interpolation.value} onSelect={(mode) => (interpolation.value = mode)} />
        <RenderSelect />
        <KeepLookButton />
        <IconButton icon="close" label="Close the time line; the look is as it was" onClick={() => (timelineOpen.value = false)} />
      </div>
    </section>
  );
}
