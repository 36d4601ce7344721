/** Thumbnails of environments: the scene's original first, then built-in and imported ones. */
import { useEffect, useRef } from "preact/hooks";
import { bakedEnvironmentThumbnailUrl } from "../../session/net/api";
import { bake } from "../../state/bakes";
import { look } from "../../state/look";
import { IconButton } from "../../ui/IconButton";
import { onRadioKey } from "../../ui/radio";
import {
  chooseEnvironment,
  environments,
  importProgress,
  loadEnvironments,
  importEnvironmentFile,
} from "./environments";
import { serverUrl } from "../../session/net/serverUrl";

interface EnvironmentEntry {
  map: string | null;
  /** May be truncated: the tooltip has the full name. */
  name: string;
  title: string;
  thumbnail: string;
}

function entriesOf(current: string): EnvironmentEntry[] {
  const ownEntry = {
    map: null,
    name: "Original",
    title: "The scene’s original environment",
    thumbnail: bakedEnvironmentThumbnailUrl(current),
  };
  const importedEntries = environments.value.map(({ map, name, thumbnail }) => ({ map, name, title: name, thumbnail }));
  return [ownEntry, ...importedEntries];
}

function EnvironmentTile({
  entry,
  isSelected,
  focusable,
}: {
  entry: EnvironmentEntry;
  isSelected: boolean;
  focusable: boolean;
}) {
  return (
    <button
      type="button"
      role="radio"
      aria-checked={isSelected}
      tabIndex={focusable ? 0 : -1}
      title={entry.title}
      onClick={() => chooseEnvironment(entry.map)}
    >
      <img src={serverUrl(entry.thumbnail)} alt="" width={64} height={32} />
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
        class="hidden-input"
        type="file"
        tabIndex={-1}
        aria-label="Environment file"
        accept=".hdr,.exr"
        onChange={(event) => {
          const files = [...(event.currentTarget.files ?? [])];
          event.currentTarget.value = ""; // allows choosing the same file again
          if (files.length > 0) void importEnvironmentFile(files);
        }}
      />
      <IconButton
        icon="plus"
        label="Import HDRI (HDR or EXR); or drop one on the picture"
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
          onRadioKey(event, entries.length, focusable, (index) =>
            chooseEnvironment((entries[index] as EnvironmentEntry).map),
          )
        }
      >
        {entries.map((entry, k) => (
          <EnvironmentTile key={entry.map} entry={entry} isSelected={k === selectedIndex} focusable={k === focusable} />
        ))}
      </div>
      <div class="environment-text" role="status">
        {importProgress.value}
        {map !== null && (
          <p>
            This environment was chosen after baking, so bounce light shows it more coarsely. Bake again to fix this.
          </p>
        )}
      </div>
    </>
  );
}
