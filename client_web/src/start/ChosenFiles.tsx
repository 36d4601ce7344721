/** The chosen scenes, each with its companion and missing files. */
import { fileBaseName, type SceneFile } from "./files/sceneFiles";
import { IconButton } from "../ui/IconButton";

interface ChosenFilesProps {
  scenes: readonly SceneFile[];
  /** Number of chosen companion files. */
  numParts: number;
  /** Import errors by path. */
  problems: ReadonlyMap<string, string>;
  onLeaveOut: (path: string) => void;
}

const MAX_LISTED_MISSING = 3;

function companionsText({ companions, missing }: SceneFile): string {
  const files = companions.length === 1 ? "1 file" : `${companions.length} files`;
  return companions.length + missing.length === 0 ? "" : `with ${files}`;
}

function missingText({ missing }: SceneFile): string {
  const more = missing.length > MAX_LISTED_MISSING ? ` and ${missing.length - MAX_LISTED_MISSING} more` : "";
  return `missing: ${missing.slice(0, MAX_LISTED_MISSING).join(", ")}${more}. Drop these files or their folder.`;
}

export function ChosenFiles({ scenes, numParts, problems, onLeaveOut }: ChosenFilesProps) {
  if (scenes.length === 0)
    return (
      <p class="chosen-scenes">
        <span class="quiet">No scene chosen{numParts > 0 && ". Drop the .gltf or .obj of these files."}</span>
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
          <IconButton icon="close" label={`Remove ${fileBaseName(scene.path)}`} onClick={() => onLeaveOut(scene.path)} />
        </li>
      ))}
    </ul>
  );
}
