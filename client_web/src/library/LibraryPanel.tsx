/** Measured materials to put onto objects: by dragging a ball into the picture, or by choosing one for the selection. */
import { IconButton } from "../ui/Button";
import { materialThumbnail } from "../net/api";
import { models, selectedMaterial } from "../state/store";
import { NavigationMap } from "./NavigationMap";
import { DRAG_TYPE, fittedModels, group, groups, libraryOpen, model, putOnSelected, shown } from "./library";

function Filters() {
  const label = (name: string) => models.value.find((info) => info.model === name)?.label ?? name;
  return (
    <div class="library-filters">
      <select aria-label="Kind" value={group.value} onChange={(event) => (group.value = event.currentTarget.value)}>
        <option value="all">all kinds</option>
        {groups.value.map((name) => (
          <option key={name}>{name}</option>
        ))}
      </select>
      <select aria-label="Model" value={model.value} onChange={(event) => (model.value = event.currentTarget.value)}>
        {fittedModels.value.map((name) => (
          <option key={name} value={name}>
            {label(name)}
          </option>
        ))}
      </select>
    </div>
  );
}

export function LibraryPanel() {
  return (
    <aside class="panel library" aria-label="Library of materials">
      <header class="panel-head">
        <h2>Library</h2>
        <IconButton icon="close" label="Close" onClick={() => (libraryOpen.value = false)} />
      </header>
      <p class="library-help">
        {selectedMaterial.value === null
          ? "Drag a ball onto an object, or select one first."
          : `A click puts it on ${selectedMaterial.value}; drag onto any object.`}
      </p>
      <NavigationMap />
      <Filters />
      <ul class="library-balls">
        {shown.value.map((material) => (
          <li key={material.id}>
            <button
              draggable
              title={`${material.name}. ${material.source}`}
              onClick={() => putOnSelected(material.id)}
              onDragStart={(event) => event.dataTransfer?.setData(DRAG_TYPE, material.id)}
            >
              <img src={materialThumbnail(material.id)} alt="" width={64} height={64} loading="lazy" />
              <span>{material.name}</span>
            </button>
          </li>
        ))}
      </ul>
    </aside>
  );
}
