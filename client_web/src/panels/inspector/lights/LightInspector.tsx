/** The selected light: type, emission, position and direction. */
import { editValue } from "../../../edit/edit";
import { beginDrag } from "../../../session/prepare";
import { MAX_LIGHT_NAME } from "../../../look.gen";
import type { Light, Triple } from "../../../protocol";
import { defaultLook } from "../../../state/look";
import { aimLocked } from "../../../state/panels";
import { IconButton } from "../../../ui/IconButton";
import { EditableName } from "../../../ui/EditableName";
import { LabeledSlider } from "../../../ui/LabeledSlider";
import { NumberField } from "../../../ui/NumberField";
import { Emission } from "../../lights/Emission";
import { angleFieldsOf, numbersFieldsOf, type AngleField, type NumbersField } from "../../lights/lightFields";
import { GoboField } from "./GoboField";
import { isAimed, placeLight } from "../../lights/handleGeometry";
import { IesField } from "../../lights/IesField";
import { LinkField } from "../../lights/LinkField";
import { createGroup, groupOfLight, lightGroups, moveToGroup } from "../../lights/lightGroups";
import { completeLight, LIGHT_KINDS, labelOf, changeKind, isAddedKind, type AddedKind } from "../../lights/lightKinds";
import {
  changeLight,
  duplicateLight,
  editLight,
  isAddedLight,
  lightPath,
  removeLight,
  renameLight,
} from "../../lights/lightEdits";

interface NamedLight {
  name: string;
  light: Light;
}

function NumbersFields({ name, light, numbersField }: NamedLight & { numbersField: NumbersField }) {
  const { field, label, unit } = numbersField;
  const value = (light as Partial<Record<NumbersField["field"], number | number[]>>)[field] ?? [];
  const values = Array.isArray(value) ? value : [value];
  const setValues = (next: number[]) => {
    if (field === "position") {
      const change = placeLight(light, next as Triple, aimLocked.value);
      if (change !== null) changeLight(numbersField.editLabel, name, change);
    } else if (numbersField.allows?.(next) ?? true)
      editLight(numbersField.editLabel, name, field, Array.isArray(value) ? next : next[0]);
  };
  return (
    <div class="numbers" role="group" aria-label={label} style={{ "--count": numbersField.names.length }}>
      <span class="param-label">
        {label} {unit !== "" && <small>{unit}</small>}
      </span>
      {numbersField.names.map((component, k) => (
        <label key={component}>
          <small>{component}</small>
          <NumberField
            label={`${label}, ${component}`}
            value={values[k] as number}
            minimum={numbersField.minimum}
            maximum={numbersField.maximum}
            step={numbersField.step}
            onChange={(next) => setValues(values.map((value, i) => (i === k ? next : value)))}
          />
        </label>
      ))}
    </div>
  );
}

function AngleFieldSlider({ name, light, angleField }: NamedLight & { angleField: AngleField }) {
  return (
    <LabeledSlider
      label={angleField.label}
      value={angleField.valueOf(light)}
      initial={angleField.valueOf(completeLight({ kind: light.kind }, defaultLook.value?.lights[name]))}
      minimum={angleField.minimum}
      maximum={angleField.maximum}
      scale="linear"
      unit="°"
      onChange={(angle) => editLight(angleField.editLabel, name, angleField.field, angleField.changeFor(light, angle))}
      onHold={() => beginDrag(lightPath(name))}
    />
  );
}

function LightKindSelect({ name, light }: NamedLight) {
  if (light.kind === "mesh")
    return <p class="hint">Emissive mesh with material “{light.material}”. Its position comes from the scene.</p>;
  if (!isAddedKind(light.kind))
    return <p class="hint">Lights of the scene, edited as one. Their positions and relative strengths are fixed.</p>;
  const change = (kind: AddedKind) => editValue("Change type", lightPath(name), changeKind(light, kind));
  return (
    <div class="kind">
      <select
        aria-label="Light type"
        value={light.kind}
        onChange={(event) => change(event.currentTarget.value as AddedKind)}
      >
        {LIGHT_KINDS.map(({ kind, label, help }) => (
          <option key={kind} value={kind} title={help}>
            {label}
          </option>
        ))}
      </select>
    </div>
  );
}

const NEW_GROUP = "new";

function GroupSelect({ name }: { name: string }) {
  const groups = Object.keys(lightGroups.value);
  const group = groups.indexOf(groupOfLight.value.get(name) ?? "");
  const change = (value: string) => {
    if (value === NEW_GROUP) createGroup(name);
    else moveToGroup(name, groups[Number(value)] ?? null);
  };
  return (
    <div class="kind">
      <select aria-label="Light group" value={group} onChange={(event) => change(event.currentTarget.value)}>
        <option value={-1}>No group</option>
        {groups.map((label, k) => (
          <option key={label} value={k}>
            {label}
          </option>
        ))}
        <option value={NEW_GROUP}>New group</option>
      </select>
    </div>
  );
}

function AimLockSwitch() {
  return (
    <label class="aim-lock" title="Keep aiming at the same point when the light moves">
      <input
        type="checkbox"
        checked={aimLocked.value}
        onChange={(event) => (aimLocked.value = event.currentTarget.checked)}
      />
      Lock target
    </label>
  );
}

export function LightInspector({ name, light }: NamedLight) {
  const initial = defaultLook.value?.lights[name];
  return (
    <div class="panel inspector">
      <header class="panel-head">
        <h2 class="spacer">
          {isAddedLight(name) ? (
            <EditableName
              key={name}
              class="light-name"
              name={name}
              maximum={MAX_LIGHT_NAME}
              onRename={(next) => renameLight(name, next)}
            />
          ) : (
            name
          )}
        </h2>
        {isAddedKind(light.kind) && (
          <IconButton icon="copy" label="Duplicate light" onClick={() => duplicateLight(name)} />
        )}
        {isAddedLight(name) ? (
          <IconButton icon="trash" label="Remove light" keys="Delete" onClick={() => removeLight(name)} />
        ) : (
          <IconButton
            icon="reset"
            label="Reset light"
            disabled={initial === light}
            onClick={() => editValue("Reset", lightPath(name), initial)}
          />
        )}
      </header>
      <section class="card light-card" aria-label={labelOf(light.kind)}>
        <LightKindSelect name={name} light={light} />
        <GroupSelect name={name} />
        <Emission name={name} light={light} />
        {isAimed(light) && <AimLockSwitch />}
        {numbersFieldsOf(light).map((field) => (
          <NumbersFields key={field.label} name={name} light={light} numbersField={field} />
        ))}
        {angleFieldsOf(light).map((field) => (
          <AngleFieldSlider key={field.label} name={name} light={light} angleField={field} />
        ))}
        {"profile" in light && <IesField name={name} profile={light.profile ?? null} />}
        {"gobo" in light && <GoboField name={name} gobo={light.gobo ?? null} />}
        <LinkField label="Lights" path={lightPath(name, "link")} link={light.link ?? null} />
        <LinkField label="Shadows" path={lightPath(name, "shadow_link")} link={light.shadow_link ?? null} />
      </section>
    </div>
  );
}
