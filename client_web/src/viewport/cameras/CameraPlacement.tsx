/** The camera placement viewport: navigate the scene in plain colors, then save the camera. */
import { useEffect, useId, useRef, useState } from "preact/hooks";
import type { SceneBody, Triple } from "../../protocol";
import type { BakeSize } from "../../session/scene/recipe";
import { IconButton } from "../../ui/IconButton";
import { LabeledSlider } from "../../ui/LabeledSlider";
import { renderPlacement, nextCameraName, getPlacementView, listCameras, MAX_NAME, pickTarget } from "./cameraRequests";
import { saveCameraAs } from "./savedCameras";
import { CameraMotion } from "./cameraMotion";
import { poseOf, MAX_YFOV, MIN_YFOV, orbitOf, withFieldOfView, type Bounds, type CameraPose, type Orbit } from "./orbit";
import { PlacementImages } from "./placementImages";
import { CAMERA_STEPS } from "./cameraSteps";
import { orbitKeyStep, useCameraControl } from "./useCameraControl";
import "./cameras.css";

const MOVING_SIZE: BakeSize = [400, 300];
const IDLE_SIZE: BakeSize = [960, 720];

interface Props {
  scene: SceneBody;
  /** Initial pose; null: the scene's first camera. */
  from: CameraPose | null;
  /** The camera being moved, and maybe renamed; null: a new one. */
  name: string | null;
  onSave: (name: string) => void;
  onClose: () => void;
}

interface PlacementStart {
  bounds: Bounds;
  first: Orbit;
  /** An orbit that shows the whole scene. */
  overview: Orbit;
}

/** The scene's bounds, and the initial orbit, by default of its first camera: it orbits the point in the image's
 * center. */
async function startPlacement(scene: string, from: CameraPose | null): Promise<PlacementStart> {
  const [{ bounds_min, bounds_max, default_camera }, cameras] = await Promise.all([getPlacementView(scene), listCameras(scene)]);
  const bounds: Bounds = { lowest: bounds_min as Triple, highest: bounds_max as Triple };
  const frame = from ?? cameras[0] ?? default_camera;
  const target = await pickTarget(scene, frame, IDLE_SIZE, IDLE_SIZE[0] / 2, IDLE_SIZE[1] / 2);
  return { bounds, first: orbitOf(frame, bounds, target), overview: orbitOf(default_camera, bounds) };
}

export function CameraPlacement({ scene, from, name, onSave, onClose }: Props) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [start, setStart] = useState<PlacementStart | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    dialog.current?.showModal();
    startPlacement(scene.id, from).then(setStart, (error: unknown) => setProblem((error as Error).message));
  }, [scene.id, from]);
  const title = name === null ? `New camera in “${scene.name}”` : `Move “${name}”`;
  return (
    <dialog class="placement" ref={dialog} aria-label={title} onClose={onClose} onKeyDown={(event) => event.stopPropagation()}>
      <header class="panel-head">
        <h2>{title}</h2>
        <IconButton icon="close" label="Close" onClick={() => dialog.current?.close()} />
      </header>
      {start === null ? (
        <p class="placement-wait">{problem || "Loading the scene…"}</p>
      ) : (
        <PlacementView scene={scene} {...start} name={name} onSave={onSave} />
      )}
    </dialog>
  );
}

/** The placed camera and its image. */
function usePlacementCamera(scene: string, canvas: { current: HTMLCanvasElement | null }, first: Orbit, fail: (text: string) => void) {
  const [orbit, setOrbit] = useState(first);
  const pipeline = useRef<{ motion: CameraMotion; images: PlacementImages } | null>(null);
  useEffect(() => {
    const images = new PlacementImages(
      (frame, size) => renderPlacement(scene, frame, size),
      async (blob) => {
        const bitmap = await createImageBitmap(blob);
        if (canvas.current !== null) {
          canvas.current.width = bitmap.width;
          canvas.current.height = bitmap.height;
          canvas.current.getContext("2d")?.drawImage(bitmap, 0, 0);
        }
        bitmap.close();
        fail("");
      },
      (error) => fail(error instanceof Error ? error.message : String(error)),
    );
    const motion = new CameraMotion(first, (displayed, isLast) => images.show(poseOf(displayed), isLast ? IDLE_SIZE : MOVING_SIZE));
    pipeline.current = { motion, images };
    images.show(poseOf(first), IDLE_SIZE);
    return () => {
      motion.end();
      images.close();
    };
  }, [scene, canvas, first, fail]);
  const change = (update: (orbit: Orbit) => Orbit) => {
    const motion = pipeline.current?.motion;
    motion?.change(update);
    if (motion !== undefined) setOrbit(motion.target);
  };
  return { orbit, change };
}

interface PlacementProps extends PlacementStart {
  scene: SceneBody;
  name: string | null;
  onSave: (name: string) => void;
}

function PlacementView({ scene, bounds, first, overview, name, onSave }: PlacementProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [imageError, setImageError] = useState(""); // a later image does not resolve a rejected save
  const [saveError, setSaveError] = useState("");
  const [cameraName, setCameraName] = useState(name ?? nextCameraName(scene.views.map((view) => view.name)));
  const { orbit, change } = usePlacementCamera(scene.id, canvas, first, setImageError);
  const field = useId();

  const seeAll = () => change(() => overview);
  const lookAt = async (u: number, v: number) => {
    setSaveError("");
    try {
      const target = await pickTarget(scene.id, poseOf(orbit), IDLE_SIZE, u * IDLE_SIZE[0], v * IDLE_SIZE[1]);
      if (target !== null) change((now) => ({ ...now, target }));
    } catch (error) {
      setSaveError((error as Error).message);
    }
  };
  const save = async (event: Event) => {
    event.preventDefault();
    setSaveError("");
    try {
      await saveCameraAs(scene.id, cameraName.trim(), poseOf(orbit), name);
      onSave(cameraName.trim());
    } catch (error) {
      setSaveError((error as Error).message);
    }
  };
  const control = useCameraControl(change, bounds, (u, v) => void lookAt(u, v));
  return (
    <form onSubmit={(event) => void save(event)}>
      <canvas
        ref={canvas}
        width={IDLE_SIZE[0]}
        height={IDLE_SIZE[1]}
        tabIndex={0}
        role="img"
        aria-label="Camera view. Arrow keys: orbit. Shift+arrows: pan. + and −: dolly. F: show all."
        onKeyDown={(event) => {
          if (event.key === "f" || event.key === "F") seeAll();
          else if (!orbitKeyStep(change, bounds, event.key, event.shiftKey)) return;
          event.preventDefault();
        }}
        {...control}
      />
      <p class="placement-help">
        Drag to orbit, Shift- or right-drag to pan, scroll to zoom, click to focus.
      </p>
      <div class="placement-steps" role="group" aria-label="Move the camera">
        {CAMERA_STEPS.map(({ key, sign, label }) => (
          <button key={key} type="button" title={label} aria-label={label} onClick={() => orbitKeyStep(change, bounds, key, false)}>
            {sign}
          </button>
        ))}
        <button type="button" title="Show the whole scene (F)" onClick={seeAll}>
          Show all
        </button>
      </div>
      <LabeledSlider
        label="Field of view"
        unit="°"
        title="Vertical"
        value={orbit.yfov}
        minimum={MIN_YFOV}
        maximum={MAX_YFOV}
        scale="log"
        onChange={(yfov) => change((now) => withFieldOfView(now, yfov))}
      />
      <div class="placement-keep">
        <label for={field}>Name</label>
        <input id={field} value={cameraName} maxLength={MAX_NAME} onInput={(event) => setCameraName(event.currentTarget.value)} />
        <button class="primary" disabled={cameraName.trim() === ""}>
          Save camera
        </button>
      </div>
      <p class="placement-problem" role="alert">
        {saveError || imageError}
      </p>
    </form>
  );
}
