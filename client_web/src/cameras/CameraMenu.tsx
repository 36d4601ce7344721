/** Beside a picture whose eye moves: how wide it looks, how large its picture is, and cameras that are kept with the scene:
 * to look from, to rename, to delete. */
import { useEffect, useRef, useState } from "preact/hooks";
import { MAX_EYE_PIXELS, type CameraEntry } from "../protocol";
import { view } from "../state/views";
import { IconButton } from "../ui/Button";
import { EditableName } from "../ui/EditableName";
import { LabelledSlider } from "../ui/LabelledSlider";
import { NumberField } from "../ui/NumberField";
import { attempt } from "../ui/toasts";
import { useClosing } from "../ui/useClosing";
import { freeName, listCameras, MAX_NAME } from "./calls";
import { lookFrom, type Eye } from "./eye";
import { keepAs, removeCamera } from "./keeping";
import { levelled, MAX_YFOV, MIN_YFOV, withAngle } from "./orbit";

const LEAST_SIDE = 16;
const MOST_SIDE = 4096;
const UPRIGHT = 1e-3; // radians

/** Width and height; what would be too many pixels takes from the other side. */
function PictureSize({ eye }: { eye: Eye }) {
  const [width, height] = eye.size;
  const most = (other: number) => Math.floor(MAX_EYE_PIXELS / other);
  const field = (label: string, value: number, onChange: (value: number) => void) => (
    <NumberField label={label} value={value} minimum={LEAST_SIDE} maximum={MOST_SIDE} step={10} whole onChange={onChange} />
  );
  return (
    <div class="camera-size">
      <span>Picture</span>
      {field("Width of the picture, pixels", width, (next) => eye.resize([next, Math.min(height, most(next))]))}×
      {field("Height of the picture, pixels", height, (next) => eye.resize([Math.min(width, most(next)), next]))}
      <button title="As large as was baked" onClick={() => eye.resize(null)}>
        As baked
      </button>
    </div>
  );
}

interface ListProps {
  scene: string;
  eye: Eye;
  name: string;
}

function Cameras({ scene, eye, name }: ListProps) {
  const [cameras, setCameras] = useState<CameraEntry[]>([]);
  const read = async () => setCameras(await listCameras(scene));
  const run = (work: () => Promise<void>) => void attempt(work).then(() => attempt(read));
  useEffect(() => void attempt(read), [scene]);
  const keep = () => run(() => keepAs(scene, freeName(cameras.map((camera) => camera.name)), eye.frame, null));
  const remove = (camera: CameraEntry) => run(() => removeCamera(scene, camera, () => void attempt(read)));
  return (
    <>
      <ul aria-label="Cameras of the scene">
        {cameras.map((camera) => (
          <li key={camera.name}>
            <IconButton icon="eye" label={`Look from ${camera.name}`} onClick={() => lookFrom(name, camera)} />
            {camera.is_placed ? (
              <EditableName
                class="name"
                name={camera.name}
                maximum={MAX_NAME}
                onRename={(to) => run(() => keepAs(scene, to, camera, camera.name))}
              />
            ) : (
              <span class="name">{camera.name}</span>
            )}
            {camera.is_placed && (
              <IconButton icon="trash" label={`Delete ${camera.name}`} onClick={() => remove(camera)} />
            )}
          </li>
        ))}
      </ul>
      <IconButton icon="plus" label="Keep this camera with the scene" onClick={keep}>
        Keep this camera
      </IconButton>
    </>
  );
}

export function CameraMenu({ scene, eye, name }: ListProps) {
  const [open, setOpen] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  useClosing(open, menu, () => setOpen(false));
  view.value; // the eye has moved
  const escape = (event: KeyboardEvent) => event.key === "Escape" && setOpen(false);
  return (
    <div class="menu" ref={menu} onKeyDown={escape}>
      <button aria-expanded={open} title="Angle, size, and cameras of the scene" onClick={() => setOpen(!open)}>
        Camera ▾
      </button>
      {open && (
        <div class="menu-body camera-menu" role="dialog" aria-label="Camera">
          <LabelledSlider
            label="Angle"
            unit="°"
            title="Vertical field of view"
            value={eye.orbit.yfov}
            minimum={MIN_YFOV}
            maximum={MAX_YFOV}
            scale="log"
            onChange={(yfov) => eye.change((now) => withAngle(now, yfov))}
          />
          {Math.abs(eye.orbit.roll) > UPRIGHT && (
            <button title="Stand the picture upright" onClick={() => eye.change(levelled)}>
              Level
            </button>
          )}
          <PictureSize eye={eye} />
          <Cameras scene={scene} eye={eye} name={name} />
        </div>
      )}
    </div>
  );
}
