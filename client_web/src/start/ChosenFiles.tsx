/** The scenes among the chosen files, each with what belongs to it and what it lacks. */
import { fileBaseName, type SceneFile } from "./files/sceneFiles";
import { IconButton } from "../ui/IconButton";

interface ChosenFilesProps {
  scenes: readonly SceneFile[];
  /** Of chosen files that are parts of scenes. */
  numParts: number;
  /** Why the server refused some, by path. */
  problems: ReadonlyMap<string, string>;
  onLeaveOut(path: string): void;
}

const MAX_LISTED_MISSING = 3;

function companionsText({ companions, missing }: SceneFile): string {
  const files = companions.length === 1 ? "1 file" : `${companions.length} files`;
  return companions.length + missing.length === 0 ? "" : `with ${files}`;
}

function missingText({ missing }: SceneFile): string {
  const more = missing.length > MAX_LISTED_MISSING ? ` and ${missing.length - MAX_LISTED_MISSING} more` : "";
  return `lacks ${missing.slice(0, MAX_LISTED_MISSING).join(", ")}${more}: drop them too, or the folder they lie in`;
}

export function ChosenFiles({ scenes, numParts, problems, onLeaveOut }: ChosenFilesProps) {
  if (scenes.length === 0)
    return (
      <p class="chosen-scenes">
        <span class="quiet">Scene: none{numParts > 0 && "; drop the .gltf or .obj that these files belong to"}</span>
      </p>
    );
  return (
    <ul class="chosen-scenes" aria-label="Chosen scenes">
      {scenes.map((scene) => (
        <li key={scene.path}>
          <span title={scene.path}>
            Scene: {scene.file.name} <span class="quiet">{companionsText(scene)}</span>
          </span>
          {scene.missing.length > 0 && <span class="wrong">{missingText(scene)}</span>}
          {problems.has(scene.path) && <span class="wrong">{problems.get(scene.path)}</span>}
          <IconButton icon="close" label={`Leave out ${fileBaseName(scene.path)}`} onClick={() => onLeaveOut(scene.path)} />
        </li>
      ))}
    </ul>
  );
}
