/** The scenes among the chosen files, each with what belongs to it and what it lacks. */
import { stem, type ScenePart } from "../files/files";
import { IconButton } from "../ui/Button";

interface Props {
  scenes: readonly ScenePart[];
  /** Of chosen files that are parts of scenes. */
  numParts: number;
  /** Why the server refused some, by path. */
  problems: ReadonlyMap<string, string>;
  onLeaveOut(path: string): void;
}

const MAX_NAMED = 3;

function words({ companions, missing }: ScenePart): string {
  const files = companions.length === 1 ? "1 file" : `${companions.length} files`;
  return companions.length + missing.length === 0 ? "" : `with ${files}`;
}

function lack({ missing }: ScenePart): string {
  const more = missing.length > MAX_NAMED ? ` and ${missing.length - MAX_NAMED} more` : "";
  return `lacks ${missing.slice(0, MAX_NAMED).join(", ")}${more}: drop them too, or the folder they lie in`;
}

export function ChosenScenes({ scenes, numParts, problems, onLeaveOut }: Props) {
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
            Scene: {scene.file.name} <span class="quiet">{words(scene)}</span>
          </span>
          {scene.missing.length > 0 && <span class="wrong">{lack(scene)}</span>}
          {problems.has(scene.path) && <span class="wrong">{problems.get(scene.path)}</span>}
          <IconButton icon="close" label={`Leave out ${stem(scene.path)}`} onClick={() => onLeaveOut(scene.path)} />
        </li>
      ))}
    </ul>
  );
}
