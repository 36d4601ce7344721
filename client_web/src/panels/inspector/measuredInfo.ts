/** BTFs are stored with as many components as each needs; the quality parameter cannot exceed that. */
import { getBtf } from "../../session/net/api";
import type { ParameterBody, ParamValue, Term } from "../../protocol";

const PREFIX = "btf:";
const QUALITY = "components";

/** The id of a term's BTF. */
export function btfOf({ data }: Term): string | null {
  return data?.startsWith(PREFIX) ? data.slice(PREFIX.length) : null;
}

export const getStoredQuality = async (id: string): Promise<number> => (await getBtf(id)).components;

/** A parameter's declaration limited to the stored components; null if their number is unknown. */
export function limitToStored(info: ParameterBody, storedQuality: number | null): ParameterBody {
  if (info.name !== QUALITY || storedQuality === null) return info;
  const maximum = Math.min(info.maximum, Math.max(1, storedQuality));
  return { ...info, maximum, default: maximum };
}

/** The effective number of components, at most those stored. */
export function isWithinStored(info: ParameterBody, value: ParamValue | undefined): ParamValue {
  return info.name === QUALITY && typeof value === "number" ? Math.min(value, info.maximum) : (value ?? info.default);
}
