/** Chosen scenes on their way to the server. */
import { useState } from "preact/hooks";
import { stem, type Chosen } from "../files/files";
import { uploadScene } from "../net/upload";
import type { SceneBody } from "../protocol";
import { mended, showError } from "../ui/toasts";

export interface Sending {
  name: string;
  /** Of the bytes that are sent. */
  share: number;
  /** Which one it is, from 1, of how many. */
  number: number;
  count: number;
}

interface Outcome {
  imported: SceneBody[];
  /** Paths of the scenes that were imported. */
  done: ReadonlySet<string>;
}

interface Import {
  sending: Sending | null;
  /** What was wrong with the scenes that were refused, by their paths. */
  problems: ReadonlyMap<string, string>;
  forgetProblems(): void;
  /** One after another; what was refused is said. */
  send(chosen: Chosen, ground: boolean): Promise<Outcome>;
}

function sayRefused(problems: ReadonlyMap<string, string>, numSent: number): void {
  if (problems.size === 0) return;
  showError(
    numSent === 1
      ? [...problems].map(([path, problem]) => `${path}: ${problem}`).join()
      : `${problems.size} of ${numSent} scenes could not be imported; the list says why.`,
    "files",
  );
}

export function useImport(): Import {
  const [sending, setSending] = useState<Sending | null>(null);
  const [problems, setProblems] = useState<ReadonlyMap<string, string>>(new Map());
  const send = async ({ scenes, environment }: Chosen, ground: boolean) => {
    const imported: SceneBody[] = [];
    const done = new Set<string>();
    const refused = new Map<string, string>();
    mended("files");
    for (const [k, scene] of scenes.entries()) {
      const name = stem(scene.path);
      try {
        const order = { scene, companions: scene.companions, environment, name, ground };
        const which = { name, number: k + 1, count: scenes.length };
        setSending({ ...which, share: 0 });
        imported.push(await uploadScene(order, (share) => setSending({ ...which, share })));
        done.add(scene.path);
      } catch (error) {
        refused.set(scene.path, (error as Error).message);
      }
    }
    setSending(null);
    setProblems(refused);
    sayRefused(refused, scenes.length);
    return { imported, done };
  };
  return { sending, problems, forgetProblems: () => setProblems(new Map()), send };
}
