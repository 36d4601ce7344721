/** Places a camera: the scene in plain colours, moved by hand until it shows what the picture shall show. */
import { useEffect, useId, useRef, useState } from "preact/hooks";
import type { SceneBody, Triple } from "../protocol";
import type { Size } from "../scene/recipe";
import { IconButton } from "../ui/Button";
import { LabelledSlider } from "../ui/LabelledSlider";
import { finderPicture, freeName, getFinder, listCameras, MAX_NAME, placeAt } from "./calls";
import { keepAs } from "./keeping";
import { Motion } from "./motion";
import { frameOf, MAX_YFOV, MIN_YFOV, orbitOf, withAngle, type Bounds, type Frame, type Orbit } from "./orbit";
import { Pictures } from "./pictures";
import { STEPS } from "./steps";
import { step, useHand } from "./useHand";
import "./cameras.css";

const MOVING: Size = [400, 300];
const RESTING: Size = [960, 720];

interface Props {
  scene: SceneBody;
  /** Where it begins; null: where the scene's first camera is. */
  from: Frame | null;
  /** The camera that is moved, and may be renamed; null: a new one. */
  name: string | null;
  onKept(name: string): void;
  onClose(): void;
}

interface Begun {
  bounds: Bounds;
  first: Orbit;
  /** Sees all of the scene. */
  whole: Orbit;
}

/** Where the scene is, and where hands begin, else at its first camera: they turn about what the middle of the picture
 * shows. */
async function begin(scene: string, from: Frame | null): Promise<Begun> {
  const [{ lowest, highest, framing }, cameras] = await Promise.all([getFinder(scene), listCameras(scene)]);
  const bounds: Bounds = { lowest: lowest as Triple, highest: highest as Triple };
  const frame = from ?? cameras[0] ?? framing;
  const place = await placeAt(scene, frame, RESTING, RESTING[0] / 2, RESTING[1] / 2);
  return { bounds, first: orbitOf(frame, bounds, place), whole: orbitOf(framing, bounds) };
}

export function Finder({ scene, from, name, onKept, onClose }: Props) {
  const dialog = useRef<HTMLDialogElement>(null);
  const [begun, setBegun] = useState<Begun | null>(null);
  const [problem, setProblem] = useState("");
  useEffect(() => {
    dialog.current?.showModal();
    begin(scene.id, from).then(setBegun, (error: Error) => setProblem(error.message));
  }, [scene.id]);
  const title = name === null ? `Place a camera in “${scene.name}”` : `Move “${name}”`;
  return (
    <dialog class="finder" ref={dialog} aria-label={title} onClose={onClose} onKeyDown={(event) => event.stopPropagation()}>
      <header class="panel-head">
        <h2>{title}</h2>
        <IconButton icon="close" label="Close" onClick={() => dialog.current?.close()} />
      </header>
      {begun === null ? (
        <p class="finder-wait">{problem || "Reading the scene…"}</p>
      ) : (
        <Placing scene={scene} {...begun} name={name} onKept={onKept} />
      )}
    </dialog>
  );
}

/** Where the hand has put the camera, and the picture that follows it. */
function useMoved(scene: string, canvas: { current: HTMLCanvasElement | null }, first: Orbit, fail: (text: string) => void) {
  const [orbit, setOrbit] = useState(first);
  const parts = useRef<{ motion: Motion; pictures: Pictures } | null>(null);
  useEffect(() => {
    const pictures = new Pictures(
      (frame, size) => finderPicture(scene, frame, size),
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
    const motion = new Motion(first, (shown, isLast) => pictures.show(frameOf(shown), isLast ? RESTING : MOVING));
    parts.current = { motion, pictures };
    pictures.show(frameOf(first), RESTING);
    return () => {
      motion.end();
      pictures.close();
    };
  }, [scene]);
  const change = (by: (orbit: Orbit) => Orbit) => {
    const motion = parts.current?.motion;
    motion?.change(by);
    if (motion !== undefined) setOrbit(motion.target);
  };
  return { orbit, change };
}

interface PlacingProps extends Begun {
  scene: SceneBody;
  name: string | null;
  onKept(name: string): void;
}

function Placing({ scene, bounds, first, whole, name, onKept }: PlacingProps) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [unseen, setUnseen] = useState(""); // a picture that comes after says nothing about what was refused
  const [refused, setRefused] = useState("");
  const [called, setCalled] = useState(name ?? freeName(scene.views.map((view) => view.name)));
  const { orbit, change } = useMoved(scene.id, canvas, first, setUnseen);
  const field = useId();

  const seeAll = () => change(() => whole);
  const lookAt = async (u: number, v: number) => {
    setRefused("");
    try {
      const place = await placeAt(scene.id, frameOf(orbit), RESTING, u * RESTING[0], v * RESTING[1]);
      if (place !== null) change((now) => ({ ...now, target: place }));
    } catch (error) {
      setRefused((error as Error).message);
    }
  };
  const keep = async (event: Event) => {
    event.preventDefault();
    setRefused("");
    try {
      await keepAs(scene.id, called.trim(), frameOf(orbit), name);
      onKept(called.trim());
    } catch (error) {
      setRefused((error as Error).message);
    }
  };
  const hand = useHand(change, bounds, (u, v) => void lookAt(u, v));
  return (
    <form onSubmit={keep}>
      <canvas
        ref={canvas}
        width={RESTING[0]}
        height={RESTING[1]}
        tabIndex={0}
        role="img"
        aria-label="What the camera sees. Arrows turn, with Shift they slide, + and − go nearer and farther, F shows everything"
        onKeyDown={(event) => {
          if (event.key === "f" || event.key === "F") seeAll();
          else if (!step(change, bounds, event.key, event.shiftKey)) return;
          event.preventDefault();
        }}
        {...hand}
      />
      <p class="finder-help">
        Drag turns. Shift or the right button slides. The wheel goes nearer. A click looks at what is there.
      </p>
      <div class="finder-steps" role="group" aria-label="Move the camera">
        {STEPS.map(({ key, sign, label }) => (
          <button key={key} type="button" title={label} aria-label={label} onClick={() => step(change, bounds, key, false)}>
            {sign}
          </button>
        ))}
        <button type="button" title="See everything (F)" onClick={seeAll}>
          See everything
        </button>
      </div>
      <LabelledSlider
        label="Angle"
        unit="°"
        title="Vertical field of view"
        value={orbit.yfov}
        minimum={MIN_YFOV}
        maximum={MAX_YFOV}
        scale="log"
        onChange={(yfov) => change((now) => withAngle(now, yfov))}
      />
      <div class="finder-keep">
        <label for={field}>Name</label>
        <input id={field} value={called} maxLength={MAX_NAME} onInput={(event) => setCalled(event.currentTarget.value)} />
        <button class="primary" disabled={called.trim() === ""}>
          Keep camera
        </button>
      </div>
      <p class="finder-problem" role="alert">
        {refused || unseen}
      </p>
    </form>
  );
}
