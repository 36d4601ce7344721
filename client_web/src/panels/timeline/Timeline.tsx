/** Looks as keyframes: played and scrubbed in the image, rendered as numbered frames or a video. */
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
  durations,
  keyTimes,
  MAX_DURATION,
  MIN_DURATION,
  setKeyframeDuration,
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
  { value: "parameters", label: "Parameters", title: "Interpolate each parameter; roughness on a logarithmic scale" },
  { value: "map", label: "Material map", title: "Move Cook–Torrance materials across the material map (Ngan)" },
  { value: "map_low", label: "Löw’s map", title: "Move Cook–Torrance materials across the map of Löw’s fits" },
] as const;

const MOTION_LABELS: Record<CameraPathMode, string> = {
  still: "Fixed camera",
  around: "Orbit once",
  along: "Camera path",
  object: "Rotate object",
  environment: "Rotate environment",
};
const FIXED_CAMERA_MOTIONS: CameraPathMode[] = ["still", "environment"];

/** Chooses the motion during playback. */
function MotionSelect() {
  const options = Object.entries(MOTION_LABELS).filter(
    ([mode]) => hasFreeCamera.value || FIXED_CAMERA_MOTIONS.includes(mode as CameraPathMode),
  );
  return (
    <select
      aria-label="Motion"
      title="Orbit the camera from the first look, move it from look to look, or rotate the object or the environment in front of a fixed camera"
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

/** Hint while there is nothing to play. */
function keyframeHint(): string | null {
  const [numKeyframes, missing] = [keyframes.value.length, fewestKeyframes.value - keyframes.value.length];
  if (missing === 2) return "Add two looks to blend between them, or one look and choose what rotates.";
  if (missing === 1) return numKeyframes === 0 ? "Add a look." : "Add another look, or choose what rotates.";
  return frameLookList.value === null ? "Computing transitions…" : null;
}

function PlaybackControls() {
  const ready = frameLookList.value !== null;
  return (
    <div class="timeline-transport">
      <IconButton
        icon={isPlaying.value ? "pause" : "play"}
        label={isPlaying.value ? "Pause" : "Play"}
        keys="K"
        disabled={!ready}
        onClick={togglePlay}
      />
      <div class="timeline-track">
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
              <span key={`${index} ${name}`} style={{ left: `${100 * (keyTimes.value[index] ?? 0)}%` }} />
            ))}
          </div>
        )}
      </div>
      <label class="timeline-seconds">
        <NumberField
          label="Total seconds"
          value={seconds.value}
          minimum={MIN_SECONDS}
          maximum={MAX_SECONDS}
          step={0.5}
          onChange={(value) => (seconds.value = value)}
        />
        seconds total
      </label>
      <ToggleButton icon="loop" label="Loop" state={isLooping} />
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
          seek(keyTimes.value[index] ?? 0);
        }}
      >
        {name}
      </button>
      {hasFreeCamera.value && (
        <IconButton
          icon="view"
          label={`Use current camera for ${name}`}
          onClick={() => {
            const camera = currentPose();
            if (camera !== null) setKeyframeCamera(index, camera);
          }}
        />
      )}
      {index < last && (
        <NumberField
          label={`Relative time from ${name} to the next look`}
          value={durations.value[index] ?? 1}
          minimum={MIN_DURATION}
          maximum={MAX_DURATION}
          step={0.1}
          onChange={(value) => setKeyframeDuration(index, value)}
        />
      )}
      <IconButton
        icon="earlier"
        label={`Move ${name} earlier`}
        disabled={index === 0}
        onClick={() => moveKeyframe(index, -1)}
      />
      <IconButton
        icon="later"
        label={`Move ${name} later`}
        disabled={index === last}
        onClick={() => moveKeyframe(index, 1)}
      />
      <IconButton icon="close" label={`Remove ${name}`} onClick={() => removeKeyframe(index)} />
    </li>
  );
}

/** Looks that can be added to the timeline, by the value of their option. */
function lookChoices(): Map<string, { name: string; look: Partial<Look> }> {
  const variants = (scene.value?.variants ?? []).map(({ name, look: namedLook }) => ({ name, look: namedLook }));
  return new Map([...savedLooks.value, ...variants].map((partialLook, k) => [`${k}`, partialLook]));
}

function AddKeyframe() {
  const lookChoiceMap = lookChoices();
  const addChoice = (choiceKey: string) => {
    const live = look.peek();
    if (choiceKey === "live" && live !== null)
      addKeyframe({ name: nextKeyframeName(), look: live, camera: currentPose() });
    const saved = lookChoiceMap.get(choiceKey);
    if (saved !== undefined) addKeyframe({ name: saved.name, look: completeLook(saved.look), camera: currentPose() });
  };
  return (
    <select
      aria-label="Add a look to the timeline"
      value=""
      disabled={keyframes.value.length >= MAX_KEYFRAMES || look.value === null}
      onChange={(event) => {
        addChoice(event.currentTarget.value);
        event.currentTarget.value = "";
      }}
    >
      <option value="">Add a look…</option>
      <option value="live">Current look</option>
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
      aria-label="Render timeline"
      value=""
      disabled={busy}
      onChange={(event) => {
        const [format, how] = event.currentTarget.value.split(" ");
        event.currentTarget.value = "";
        void exportAnimation(format as "png" | "mp4", how === "exact" ? "exact" : "interactive");
      }}
    >
      <option value="">Render…</option>
      {hasFreeCamera.value && <option value="mp4 quick">Video (fast), {count} frames</option>}
      <option value="mp4 exact">
        Video{hasFreeCamera.value ? " (full quality)" : ""}, {count} frames at {FPS} fps
      </option>
      {hasFreeCamera.value && <option value="png quick">PNG sequence (fast), ZIP</option>}
      <option value="png exact">PNG sequence{hasFreeCamera.value ? " (full quality)" : ""}, ZIP</option>
    </select>
  );
}

/** A component of its own: the previewed look changes with every frame. */
function KeepLookButton() {
  return (
    <button
      disabled={previewedStep.value === null}
      title="Continue with the look shown, as one step"
      onClick={commitShownLook}
    >
      Use this look
    </button>
  );
}

export function Timeline() {
  const hintText = keyframeHint();
  return (
    <section class="timeline" aria-label="Timeline">
      <PlaybackControls />
      <div class="timeline-keys">
        <ol aria-label="Keyframes">
          {keyframes.value.map(({ name }, index) => (
            <KeyframeTile key={`${index} ${name}`} index={index} name={name} />
          ))}
        </ol>
        <AddKeyframe />
        <span class="timeline-hint" role="status">
          {hintText}
        </span>
        <RadioRow
          label="Interpolation"
          choices={INTERPOLATIONS}
          selected={interpolation.value}
          onSelect={(mode) => (interpolation.value = mode)}
        />
        <RenderSelect />
        <KeepLookButton />
        <IconButton
          icon="close"
          label="Close timeline and restore the look"
          onClick={() => (timelineOpen.value = false)}
        />
      </div>
    </section>
  );
}
