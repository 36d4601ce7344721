/** The material library: drag a ball onto an object, or click one for the selected material. */
import { useRef } from "preact/hooks";
import { libraryOpen } from "../../state/panels";
import { models } from "../../state/scene";
import { selectedMaterial } from "../../state/selection";
import { IconButton } from "../../ui/IconButton";
import { useReturnFocus } from "../../ui/restoreFocus";
import { BtfJobs } from "./BtfJobs";
import { NavigationMap } from "./NavigationMap";
import {
  BTFS,
  DRAG_TYPE,
  IMPORTED,
  otherGroupMatches,
  fittedModels,
  group,
  groups,
  hasGroups,
  importMaterial,
  MEASURED,
  model,
  applyToSelected,
  query,
  showGroup,
  visibleEntries,
} from "./libraryItems";
import { serverUrl } from "../../session/net/serverUrl";

const UNFITTED: Record<string, string> = { [IMPORTED]: "Imported", [MEASURED]: "Measurements", [BTFS]: "BTF textures" };

const label = (name: string) => UNFITTED[name] ?? models.value.find((info) => info.model === name)?.label ?? name;

function Filters() {
  return (
    <div class="library-filters">
      <select
        aria-label="Category"
        value={group.value}
        disabled={!hasGroups.value}
        onChange={(event) => (group.value = event.currentTarget.value)}
      >
        <option value="all">All categories</option>
        {groups.value.map((name) => (
          <option key={name}>{name}</option>
        ))}
      </select>
      <select aria-label="Model" value={model.value} onChange={(event) => (model.value = event.currentTarget.value)}>
        {[...fittedModels.value, IMPORTED, MEASURED, BTFS].map((name) => (
          <option key={name} value={name}>
            {label(name)}
          </option>
        ))}
      </select>
    </div>
  );
}

/** Files dropped on the panel are imported as materials; elsewhere they would be scenes. */
function importFiles(event: DragEvent): void {
  const files = [...(event.dataTransfer?.files ?? [])];
  if (files.length === 0) return;
  event.preventDefault();
  event.stopPropagation();
  for (const file of files) void importMaterial(file);
}

export function LibraryPanel() {
  const panel = useRef<HTMLElement>(null);
  useReturnFocus(panel);
  return (
    <aside
      ref={panel}
      class="panel library"
      aria-label="Material library"
      onDragOver={(event) => event.preventDefault()}
      onDrop={importFiles}
    >
      <header class="panel-head">
        <h2>Library</h2>
        <IconButton icon="close" label="Close" onClick={() => (libraryOpen.value = false)} />
      </header>
      <p class="library-help">
        {selectedMaterial.value === null
          ? "Drag a ball onto an object, or select an object first."
          : `Click to apply to ${selectedMaterial.value} or drag onto an object.`}{" "}
        {model.value === IMPORTED
          ? "Imported materials bring their own textures."
          : "Textures aren’t kept; re-add them under Texture."}
      </p>
      <NavigationMap />
      <input
        class="library-search"
        type="search"
        placeholder="Search"
        aria-label="Search the library"
        maxLength={80}
        value={query.value}
        onInput={(event) => (query.value = event.currentTarget.value)}
        onKeyDown={(event) => event.stopPropagation()}
      />
      <Filters />
      <BtfJobs />
      {visibleEntries.value.length === 0 && query.value !== "" && (
        <div class="library-help library-elsewhere" role="status">
          No matches for “{query.value}” here{otherGroupMatches.value.length > 0 && "; found in"}:
          {otherGroupMatches.value.map(([name, num]) => (
            <button key={name} type="button" onClick={() => showGroup(name)}>
              {label(name)}: {num}
            </button>
          ))}
        </div>
      )}
      {visibleEntries.value.length === 0 && query.value === "" && model.value === IMPORTED && (
        <p class="library-help">
          No imported materials yet. Import MaterialX: a .mtlx file, or a ZIP of it with its images.
        </p>
      )}
      {visibleEntries.value.length === 0 && query.value === "" && model.value === MEASURED && (
        <p class="library-help">
          No measurements yet. Import a MERL (.binary), RGL (.bsdf) or Cornell (.brdf) file to edit its curves.
        </p>
      )}
      {visibleEntries.value.length === 0 && query.value === "" && model.value === BTFS && (
        <p class="library-help">
          No BTFs yet. Render one here, or import one: a UBO2014 .btf file, or a ZIP of images named by light and view
          direction.
        </p>
      )}
      <ul class="library-balls">
        {visibleEntries.value.map((material) => (
          <li key={material.id}>
            <button
              draggable
              title={material.description}
              onClick={() => applyToSelected(material.id)}
              onDragStart={(event) => event.dataTransfer?.setData(DRAG_TYPE, material.id)}
            >
              <img src={serverUrl(material.thumbnail)} alt="" width={64} height={64} loading="lazy" />
              <span>{material.name}</span>
            </button>
          </li>
        ))}
      </ul>
    </aside>
  );
}
