/** The camera placement viewport: navigate the scene in plain colors, then save the camera. */
import { useEffect, useId, useRef, useState } from "preact/hooks";
import type { LensBody, SceneBody, Triple } from "../../protocol";
import { LatestRequest } from "../../session/net/latestRequest";
import type { BakeSize } from "../../session/scene/recipe";
import { IconButton } from "../../ui/IconButton";
import {
  getPlacementView,
  listCameras,
  MAX_NAME,
  nextCameraName,
  pickTarget,
  renderPlacement,
  tracePlacementPath,
} from "./cameraRequests";
import { saveCameraAs } from "./savedCameras";
import { CameraMotion } from "./cameraMotion";
import { depthOf, poseOf, orbitOf, type Bounds, type CameraPose, type Orbit } from "./orbit";
import { DepthOfField } from "./DepthOfField";
import { LensSliders, StopAtWalls } from "./LensFields";
import { CAMERA_STEPS, NAVIGATION_HELP, NAVIGATION_LABELS } from "./cameraSteps";
import { navigation, stopsAtWalls, toggleNavigation, wallMargin } from "./navigation";
import { cameraKeyStep, useCameraControl } from "./useCameraControl";
import { Walker } from "./walker";
import { WallGuard } from "./wallGuard";
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
  /** An orbit in the scene's largest room; null if nothing is enclosed. */
  interior: Orbit | null;
  /** Depth of field of the first camera. */
  firstLens: LensBody | null;
}

/** The scene's bounds, and the initial orbit around the point in the image's center: by default of its first camera, or
 * inside a room that this camera sees only from outside. */
async function startPlacement(scene: string, from: CameraPose | null): Promise<PlacementStart> {
  const [{ bounds_min, bounds_max, default_camera, interior_camera, opens_inside }, cameras] = await Promise.all([
    getPlacementView(scene),
    listCameras(scene),
  ]);
  const bounds: Bounds = { lowest: bounds_min as Triple, highest: bounds_max as Triple };
  const frame: CameraPose = from ?? (opens_inside ? interior_camera : null) ?? cameras[0] ?? default_camera;
  const target = await pickTarget(scene, frame, IDLE_SIZE, IDLE_SIZE[0] / 2, IDLE_SIZE[1] / 2);
  return {
    bounds,
    first: orbitOf(frame, bounds, target),
    overview: orbitOf(default_camera, bounds),
    interior: interior_camera && orbitOf(interior_camera, bounds),
    firstLens: frame.lens ?? null,
  };
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
    <dialog
      class="placement"
      ref={dialog}
      aria-label={title}
      onClose={onClose}
      onKeyDown={(event) => event.stopPropagation()}
    >
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
function usePlacementCamera(
  scene: string,
  canvas: { current: HTMLCanvasElement | null },
  first: Orbit,
  bounds: Bounds,
  fail: (text: string) => void,
) {
  const [orbit, setOrbit] = useState(first);
  const [wall, setWall] = useState<string | null>(null);
  const pipeline = useRef<{ motion: CameraMotion; guard: WallGuard } | null>(null);
  useEffect(() => {
    const images = new LatestRequest(
      ({ frame, size }: { frame: CameraPose; size: BakeSize }) => renderPlacement(scene, frame, size),
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
    const motion = new CameraMotion(first, (displayed, isLast) =>
      images.send({ frame: poseOf(displayed), size: isLast ? IDLE_SIZE : MOVING_SIZE }),
    );
    const guard = new WallGuard(wallMargin(bounds), {
      now: () => motion.target,
      accept: (accepted) => {
        motion.change(() => accepted);
        setOrbit(accepted);
        setWall(null);
      },
      stop: ({ material }) => setWall(material),
      trace: (points) => tracePlacementPath(scene, points),
    });
    pipeline.current = { motion, guard };
    images.send({ frame: poseOf(first), size: IDLE_SIZE });
    return () => {
      guard.cancel();
      motion.end();
      images.close();
    };
  }, [scene, canvas, first, bounds, fail]);
  /** Move through anything. */
  const jump = (update: (orbit: Orbit) => Orbit) => {
    if (pipeline.current === null) return;
    const { motion, guard } = pipeline.current;
    guard.cancel();
    motion.change(update);
    setOrbit(motion.target);
    setWall(null);
  };
  const change = (update: (orbit: Orbit) => Orbit, slides = false) => {
    const guard = pipeline.current?.guard;
    if (stopsAtWalls.peek()) guard?.move(update(guard.goal), slides);
    else jump(update);
  };
  return { orbit, wall, jump, camera: { bounds, change } };
}

interface PlacementProps extends PlacementStart {
  scene: SceneBody;
  name: string | null;
  onSave: (name: string) => void;
}

function PlacementView({ scene, bounds, first, overview, interior, firstLens, name, onSave }: PlacementProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [imageError, setImageError] = useState(""); // a later image does not resolve a rejected save
  const [saveError, setSaveError] = useState("");
  const [cameraName, setCameraName] = useState(name ?? nextCameraName(scene.views.map((view) => view.name)));
  const { orbit, wall, jump, camera } = usePlacementCamera(scene.id, canvas, first, bounds, setImageError);
  const { change } = camera;
  const [lens, setLens] = useState(firstLens);
  const [focuses, setFocuses] = useState(false);
  const mode = navigation.value;
  const field = useId();

  const seeAll = () => jump(() => overview);
  const goInside = () => interior !== null && jump(() => interior);
  const lookAt = async (u: number, v: number) => {
    setSaveError("");
    try {
      const target = await pickTarget(scene.id, poseOf(orbit), IDLE_SIZE, u * IDLE_SIZE[0], v * IDLE_SIZE[1]);
      if (target === null) return;
      if (focuses && lens !== null) setLens({ ...lens, focus_distance: depthOf(orbit, target) });
      else change((now) => ({ ...now, target }));
    } catch (error) {
      setSaveError((error as Error).message);
    }
  };
  const save = async (event: Event) => {
    event.preventDefault();
    setSaveError("");
    try {
      await saveCameraAs(scene.id, cameraName.trim(), { ...poseOf(orbit), lens }, name);
      onSave(cameraName.trim());
    } catch (error) {
      setSaveError((error as Error).message);
    }
  };
  const steered = useRef(camera);
  steered.current = camera;
  const [walker] = useState(
    () =>
      new Walker(
        () => (navigation.peek() === "walk" ? steered.current : null),
        () => true,
      ),
  );
  useEffect(() => () => walker.stop(), [walker]);
  const control = useCameraControl(camera, (u, v) => void lookAt(u, v));
  return (
    <form onSubmit={(event) => void save(event)}>
      <canvas
        ref={canvas}
        width={IDLE_SIZE[0]}
        height={IDLE_SIZE[1]}
        tabIndex={0}
        role="img"
        aria-label="Camera view. Arrow keys: orbit, or turn and step. Shift+arrows: pan, or look up and down. + and −: dolly. O: walk or orbit. F: show all. I: inside."
        onKeyDown={(event) => {
          const key = event.key.toLowerCase();
          if (key === "f") seeAll();
          else if (key === "i") goInside();
          else if (key === "o") toggleNavigation();
          else if (mode === "walk" && walker.press(event)) event.stopPropagation();
          else if (!cameraKeyStep(camera, event.key, event.shiftKey)) return;
          event.preventDefault();
        }}
        onKeyUp={(event) => walker.release(event)}
        onBlur={() => walker.stop()}
        {...control}
      />
      <p class="placement-help" role="status">
        {wall === null ? `${NAVIGATION_HELP[mode]} Click to focus.` : `“${wall}” stops the camera.`}
      </p>
      <div class="placement-steps" role="group" aria-label="Move the camera">
        <button type="button" aria-pressed={mode === "walk"} title="Walk or orbit (O)" onClick={toggleNavigation}>
          {NAVIGATION_LABELS.walk}
        </button>
        {CAMERA_STEPS[mode].map(({ key, sign, label }) => (
          <button
            key={key}
            type="button"
            title={label}
            aria-label={label}
            onClick={() => cameraKeyStep(camera, key, false)}
          >
            {sign}
          </button>
        ))}
        <button type="button" title="Show the whole scene (F)" onClick={seeAll}>
          Show all
        </button>
        {interior !== null && (
          <button type="button" title="Put the camera in the largest room (I)" onClick={goInside}>
            Inside
          </button>
        )}
        <StopAtWalls title="The camera stops at surfaces" />
      </div>
      <LensSliders orbit={orbit} bounds={bounds} change={change} />
      <DepthOfField lens={lens} distance={orbit.distance} focuses={focuses} onChange={setLens} onFocuses={setFocuses} />
      <div class="placement-keep">
        <label for={field}>Name</label>
        <input
          id={field}
          value={cameraName}
          maxLength={MAX_NAME}
          onInput={(event) => setCameraName(event.currentTarget.value)}
        />
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
