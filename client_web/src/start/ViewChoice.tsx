/** Which views are baked; cameras that people place stand among them, and are moved and deleted here. */
import { useEffect, useState } from "preact/hooks";
import { listCameras } from "../cameras/calls";
import { Finder } from "../cameras/Finder";
import { removeCamera } from "../cameras/keeping";
import type { Frame } from "../cameras/orbit";
import { getScene } from "../net/api";
import { MAX_VIEWS_SHOWN, type SceneBody, type SceneView } from "../protocol";
import { IconButton } from "../ui/Button";
import { attempt } from "../ui/toasts";

interface Props {
  scene: SceneBody;
  /** Where a new camera begins; null: where the scene's first one is. */
  from: Frame | null;
  chosen: readonly string[];
  /** By what is chosen by then: cameras are kept and deleted while people go on choosing. */
  onChoose(change: (chosen: readonly string[]) => string[]): void;
}

interface Open {
  /** The camera that is moved; null: a new one. */
  name: string | null;
  from: Frame | null;
}

export function ViewChoice({ scene, from, chosen, onChoose }: Props) {
  const [views, setViews] = useState<SceneView[]>(scene.views);
  const [open, setOpen] = useState<Open | null>(null);
  const inOrder = (names: readonly string[], all: readonly SceneView[]) =>
    all.map((view) => view.name).filter((name) => names.includes(name));

  const read = async () => {
    const found = (await getScene(scene.id)).views;
    setViews(found);
    return found;
  };
  useEffect(() => void attempt(read), [scene.id]); // cameras may have come and gone since the scene was listed
  const toggle = (name: string) =>
    onChoose((now) => inOrder(now.includes(name) ? now.filter((each) => each !== name) : [...now, name], views));
  const kept = async (name: string) => {
    setOpen(null);
    const all = await attempt(read);
    if (all !== undefined) onChoose((now) => inOrder([...now, name], all));
  };
  const move = (name: string) =>
    attempt(async () => {
      const camera = (await listCameras(scene.id)).find((each) => each.name === name);
      setOpen({ name, from: camera ?? null });
    });
  const remove = (name: string) =>
    attempt(async () => {
      const camera = (await listCameras(scene.id)).find((each) => each.name === name);
      if (camera !== undefined) await removeCamera(scene.id, camera, (back) => void kept(back));
      const left = await read();
      onChoose((now) => {
        const rest = inOrder(now, left);
        return rest.length > 0 ? rest : left.slice(0, 1).map((view) => view.name);
      });
    });
  const isLast = (name: string) => chosen.length === 1 && chosen[0] === name;
  return (
    <fieldset class="bake-views">
      <legend>
        Views{views.length > MAX_VIEWS_SHOWN && `, of which the editor shows ${MAX_VIEWS_SHOWN} at once`}
      </legend>
      {views.map(({ name, is_placed }) => (
        <span class="bake-view" key={name}>
          <label>
            <input type="checkbox" checked={chosen.includes(name)} disabled={isLast(name)} onChange={() => toggle(name)} />
            {name}
          </label>
          {is_placed && <IconButton icon="handles" label={`Move or rename ${name}`} onClick={() => void move(name)} />}
          {is_placed && <IconButton icon="trash" label={`Delete ${name}`} onClick={() => void remove(name)} />}
        </span>
      ))}
      <button type="button" onClick={() => setOpen({ name: null, from })}>
        Place a camera…
      </button>
      {open !== null && (
        <Finder
          scene={{ ...scene, views }}
          from={open.from}
          name={open.name}
          onKept={(name) => void kept(name)}
          onClose={() => setOpen(null)}
        />
      )}
    </fieldset>
  );
}
