/** Procedural built-in scenes: one click opens one. */
import { useEffect, useState } from "preact/hooks";
import { listBuiltIns, createBuiltInScene } from "../session/net/api";
import type { ExampleSceneBody, SceneBody } from "../protocol";
import { viewsToBake, type BakeSettings } from "../session/scene/bakeSettings";
import type { BakeMethod } from "../session/scene/bakeMethods";
import { reportErrors } from "../ui/toasts";
import { serverUrl } from "../session/net/serverUrl";

interface ExampleScenesProps {
  /** Open the scene; `choice`: bake settings, unset if it was baked before. */
  onOpen: (scene: SceneBody, choice?: BakeSettings) => void;
}

/** Default bake settings of the built-in scenes. */
function defaultSettingsFor(builtIn: ExampleSceneBody, scene: SceneBody): BakeSettings {
  return { method: builtIn.method as BakeMethod, preset: "good", size: builtIn.size, views: viewsToBake(scene) };
}

export function ExampleScenes({ onOpen }: ExampleScenesProps) {
  const [examples, setExamples] = useState<ExampleSceneBody[]>([]);
  const [creating, setCreating] = useState<string | null>(null);
  useEffect(() => void reportErrors(async () => setExamples(await listBuiltIns())), []);
  const createScene = async (builtIn: ExampleSceneBody) => {
    setCreating(builtIn.name);
    const scene = await reportErrors(() => createBuiltInScene(builtIn.name));
    setCreating(null);
    if (scene !== undefined) onOpen(scene, scene.bakes.length > 0 ? undefined : defaultSettingsFor(builtIn, scene));
  };
  return (
    <section class="built-ins" aria-label="Built-in scenes">
      <h2>Built-in scenes</h2>
      <ul>
        {examples.map((builtIn) => (
          <li key={builtIn.name}>
            <button
              disabled={creating !== null}
              aria-busy={creating === builtIn.name}
              onClick={() => void createScene(builtIn)}
            >
              <img
                src={serverUrl(`/built-in/${builtIn.name}.webp`)}
                alt=""
                onError={(event) => (event.currentTarget.style.visibility = "hidden")}
              />
              <b>{builtIn.label}</b>
              <small>{creating === builtIn.name ? "Creating…" : builtIn.description}</small>
            </button>
          </li>
        ))}
      </ul>
    </section>
  );
}
