/** Factors in stops (EV): a factor is 2 to the power of its stops. */
import { parseNumber } from "./scale";

export const stopsOf = (factor: number) => Math.log2(factor);

export const factorOf = (stops: number) => Number((2 ** stops).toPrecision(6));

/** Parse a typed factor, or stops such as "+1.5 EV"; null if invalid. */
export function parseFactor(text: string): number | null {
  const number = text.replace(/\s*EV\s*$/i, "");
  const value = parseNumber(number.replace(/^\s*\u2212/, "-"));
  return value === null || number === text ? value : factorOf(value);
}
