/** The objects of a material: which of them have one of their own. */
import type { MaterialLook } from "../../protocol";
import { look } from "../../state/look";
import { materialOf } from "../../state/scene";
import { selectMaterial } from "../../state/selection";
import { Section } from "../../ui/Section";
import { addObject, makeUnique, objectMaterialsOf, rejoin, sharedObjects } from "./objectMaterials";

interface ObjectSelectProps {
  label: string;
  objects: readonly string[];
  onSelect: (object: string) => void;
}

function ObjectSelect({ label, objects, onSelect }: ObjectSelectProps) {
  if (objects.length === 0) return null;
  return (
    <select
      class="add-term"
      aria-label={label}
      value=""
      onChange={(event) => {
        onSelect(event.currentTarget.value);
        event.currentTarget.value = "";
      }}
    >
      <option value="">{label}…</option>
      {objects.map((name) => (
        <option key={name} value={name}>
          {name}
        </option>
      ))}
    </select>
  );
}

/** An object material: its objects, and the way back to the base material. */
function OwnObjects({ name, material, base }: { name: string; material: MaterialLook; base: string }) {
  return (
    <Section title="Objects">
      <p class="aside">
        Only on {(material.objects ?? []).join(", ")}. All other objects keep “{base}”.
      </p>
      <ObjectSelect
        label="+ Add an object"
        objects={sharedObjects(look.value?.materials ?? {}, base)}
        onSelect={(object) => addObject(name, object)}
      />
      <button class="object-material" onClick={() => rejoin(name, material)}>
        Use “{base}” again
      </button>
    </Section>
  );
}

export function ObjectMaterials({ name, material }: { name: string; material: MaterialLook }) {
  if (material.base != null) return <OwnObjects {...{ name, material }} base={material.base} />;
  const info = materialOf(name);
  const materials = look.value?.materials ?? {};
  const own = objectMaterialsOf(materials, name);
  if (info === undefined || info.is_glass || (info.objects.length < 2 && own.length === 0)) return null;
  return (
    <Section title="Objects" count={info.objects.length}>
      {own.map((each) => (
        <button
          key={each.name}
          class="object-material"
          title={each.objects.join(", ")}
          onClick={() => selectMaterial(each.name)}
        >
          {each.name}
        </button>
      ))}
      <ObjectSelect
        label="Make an object’s material unique"
        objects={sharedObjects(materials, name)}
        onSelect={(object) => makeUnique(name, object)}
      />
    </Section>
  );
}
