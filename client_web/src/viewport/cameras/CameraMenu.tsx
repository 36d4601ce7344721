/** Options of a free camera: field of view, image size, renderer, and the cameras saved with the scene. */
import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { MAX_CAMERA_PIXELS, type CameraEntry } from "../../protocol";
import { activeView } from "../../state/views";
import { IconButton } from "../../ui/IconButton";
import { EditableName } from "../../ui/EditableName";
import { NumberField } from "../../ui/NumberField";
import { reportErrors } from "../../ui/toasts";
import { useDismiss } from "../../ui/useDismiss";
import { nextCameraName, listCameras, MAX_NAME } from "./cameraRequests";
import { moveFreeCamera, type FreeCamera } from "./freeCamera";
import { saveCameraAs, removeCamera } from "./savedCameras";
import { LensSliders, StopAtWalls } from "./LensFields";
import { RendererSelect } from "./RendererSelect";
import { levelOrbit } from "./orbit";

const MIN_SIDE = 16;
const MAX_SIDE = 4096;
const UPRIGHT = 1e-3; // radians

/** Width and height; too many pixels shrink the other side. */
function ImageSizeFields({ freeCamera }: { freeCamera: FreeCamera }) {
  const [width, height] = freeCamera.size;
  const maxSide = (otherSide: number) => Math.floor(MAX_CAMERA_PIXELS / otherSide);
  const field = (label: string, value: number, onChange: (value: number) => void) => (
    <NumberField
      label={label}
      value={value}
      minimum={MIN_SIDE}
      maximum={MAX_SIDE}
      step={10}
      isInteger
      onChange={onChange}
    />
  );
  return (
    <div class="camera-size">
      <span>Size</span>
      {field("Width, pixels", width, (next) => freeCamera.resize([next, Math.min(height, maxSide(next))]))}×
      {field("Height, pixels", height, (next) => freeCamera.resize([Math.min(width, maxSide(next)), next]))}
      <button title="Use the size of the bake" onClick={() => freeCamera.resize(null)}>
        Original size
      </button>
    </div>
  );
}

interface ListProps {
  scene: string;
  freeCamera: FreeCamera;
  name: string;
}

function CameraList({ scene, freeCamera, name }: ListProps) {
  const [cameras, setCameras] = useState<CameraEntry[]>([]);
  /** The new camera, whose name can be typed. */
  const [created, setCreated] = useState<string | null>(null);
  const read = useCallback(async () => setCameras(await listCameras(scene)), [scene]);
  const run = (work: () => Promise<void>) => void reportErrors(work).then(() => reportErrors(read));
  useEffect(() => void reportErrors(read), [read]);
  const save = () =>
    run(async () => {
      const newName = nextCameraName(cameras.map((camera) => camera.name));
      await saveCameraAs(scene, newName, freeCamera.pose, null);
      setCreated(newName);
    });
  const remove = (camera: CameraEntry) => run(() => removeCamera(scene, camera, () => void reportErrors(read)));
  return (
    <>
      <ul aria-label="Saved cameras">
        {cameras.map((camera) => (
          <li key={camera.name}>
            <IconButton icon="view" label={`Go to ${camera.name}`} onClick={() => moveFreeCamera(name, camera)} />
            {camera.is_placed ? (
              <EditableName
                class="name"
                name={camera.name}
                maximum={MAX_NAME}
                editing={camera.name === created}
                onDone={() => setCreated(null)}
                onRename={(to) => run(() => saveCameraAs(scene, to, camera, camera.name))}
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
      <IconButton icon="plus" label="Save this camera with the scene" onClick={save}>
        Save this camera
      </IconButton>
    </>
  );
}

export function CameraMenu({ scene, freeCamera, name }: ListProps) {
  const [open, setOpen] = useState(false);
  const menu = useRef<HTMLDivElement>(null);
  useDismiss(open, menu, () => setOpen(false));
  void activeView.value; // re-render when the camera moves
  const escape = (event: KeyboardEvent) => event.key === "Escape" && setOpen(false);
  return (
    <div class="menu" ref={menu} onKeyDown={escape}>
      <button
        aria-expanded={open}
        title="Field of view, clipping, walls, size, renderer and saved cameras"
        onClick={() => setOpen(!open)}
      >
        Options ▾
      </button>
      {open && (
        <div class="menu-body camera-menu" role="dialog" aria-label="Camera options">
          <LensSliders
            orbit={freeCamera.orbit}
            bounds={freeCamera.bounds}
            change={(update) => freeCamera.change(update)}
          />
          <StopAtWalls title="The camera stops at surfaces, unless you step through (J)" />
          {Math.abs(freeCamera.orbit.roll) > UPRIGHT && (
            <button title="Remove the camera's roll" onClick={() => freeCamera.change(levelOrbit)}>
              Level horizon
            </button>
          )}
          <ImageSizeFields freeCamera={freeCamera} />
          <RendererSelect />
          <CameraList scene={scene} freeCamera={freeCamera} name={name} />
        </div>
      )}
    </div>
  );
}
