/** Small images of environments to choose from: the scene's own first, then built-in ones, then imported ones. */
import { useEffect, useRef } from "preact/hooks";
import { bakedEnvironmentThumbnailUrl } from "../../session/net/api";
import { bake } from "../../state/bakes";
import { look } from "../../state/look";
import { IconButton } from "../../ui/IconButton";
import { onRadioKey } from "../../ui/radio";
import { chooseEnvironment, environments, importProgress, loadEnvironments, importEnvironmentFile } from "./environments";

interface EnvironmentEntry {
  map: string | null;
  /** Room is small: the whole name is its tooltip. */
  name: string;
  title: string;
  thumbnail: string;
}

function entriesOf(current: string): EnvironmentEntry[] {
  const ownEntry = { map: null, name: "Own", title: "The scene’s own", thumbnail: bakedEnvironmentThumbnailUrl(current) };
  const importedEntries = environments.value.map(({ map, name, thumbnail }) => ({ map, name, title: name, thumbnail }));
  return [ownEntry, ...importedEntries];
}

function EnvironmentTile({ entry, isSelected, focusable }: { entry: EnvironmentEntry; isSelected: boolean; focusable: boolean }) {
  return (
    <button
      type="button"
      role="radio"
      aria-checked={isSelected}
      tabIndex={focusable ? 0 : -1}
      title={entry.title}
      onClick={() => chooseEnvironment(entry.map)}
    >
      <img src={entry.thumbnail} alt="" width={64} height={32} />
      <span>{entry.name}</span>
    </button>
  );
}

export function ImportEnvironment() {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <input
        ref={input}
        class="unseen"
        type="file"
        tabIndex={-1}
        aria-label="Environment file"
        accept=".hdr,.exr"
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = ""; // the same file may be chosen again
          if (files.length > 0) void importEnvironmentFile(files);
        }}
      />
      <IconButton
        icon="plus"
        label="Import an environment, .hdr or .exr; or drop one onto the picture"
        disabled={importProgress.value !== null}
        onClick={() => input.current?.click()}
      />
    </>
  );
}

export function EnvironmentGallery() {
  const current = bake.value;
  const map = look.value?.environment.map ?? null;
  useEffect(() => void loadEnvironments(), []);
  if (current === null) return null;
  const entries = entriesOf(current);
  const selectedIndex = entries.findIndex((entry) => entry.map === map);
  const focusable = Math.max(0, selectedIndex);
  return (
    <>
      <div
        class="environments"
        role="radiogroup"
        aria-label="Environment"
        onKeyDown={(event) =>
          onRadioKey(event, entries.length, focusable, (index) => chooseEnvironment((entries[index] as EnvironmentEntry).map))
        }
      >
        {entries.map((entry, k) => (
          <EnvironmentTile key={entry.map} entry={entry} isSelected={k === selectedIndex} focusable={k === focusable} />
        ))}
      </div>
      <div class="environment-words" role="status">
        {importProgress.value}
        {map !== null && <p>Shadows were baked before this light was known: those of small lamps are approximate.</p>}
      </div>
    </>
  );
}
