/** Scenes made by code: one click takes one and opens it. */
import { useEffect, useState } from "preact/hooks";
import { listBuiltIns, takeBuiltIn } from "../net/api";
import type { BuiltInBody, SceneBody } from "../protocol";
import { viewsToBake, type BakeChoice } from "../scene/bakeChoice";
import type { Method } from "../scene/methods";
import { attempt } from "../ui/toasts";

interface Props {
  /** Without a choice, where it has been baked before. */
  onOpen(scene: SceneBody, choice?: BakeChoice): void;
}

/** The bake that shows a built-in scene well. */
function choiceFor(builtIn: BuiltInBody, scene: SceneBody): BakeChoice {
  return { method: builtIn.method as Method, preset: "good", size: builtIn.size, views: viewsToBake(scene) };
}

export function BuiltIns({ onOpen }: Props) {
  const [known, setKnown] = useState<BuiltInBody[]>([]);
  const [taking, setTaking] = useState<string | null>(null);
  useEffect(() => void attempt(async () => setKnown(await listBuiltIns())), []);
  const take = async (builtIn: BuiltInBody) => {
    setTaking(builtIn.name);
    const scene = await attempt(() => takeBuiltIn(builtIn.name));
    setTaking(null);
    if (scene !== undefined) onOpen(scene, scene.bakes.length > 0 ? undefined : choiceFor(builtIn, scene));
  };
  return (
    <section class="built-ins" aria-label="Built-in scenes">
      <h2>Built-in scenes</h2>
      <ul>
        {known.map((builtIn) => (
          <li key={builtIn.name}>
            <button disabled={taking !== null} aria-busy={taking === builtIn.name} onClick={() => void take(builtIn)}>
              <img
                src={`/built-in/${builtIn.name}.webp`}
                alt=""
                onError={(event) => (event.currentTarget.style.visibility = "hidden")}
              />
              <b>{builtIn.label}</b>
              <small>{taking === builtIn.name ? "Making it…" : builtIn.description}</small>
            </button>
          </li>
        ))}
      </ul>
    </section>
  );
}
