"""What to buy, cut and print for a mount plan: bill of materials, cut list, joints."""

from rig.build.parts.bill import Bill, BillLine, Prices, bill_of_materials, must_be_known
from rig.build.parts.cuts import Cut, cut_list
from rig.build.parts.stock import Bar, Stock, stock_bars
from rig.build.parts.stocktables import stock_csv, stock_json, taps_csv, taps_json
from rig.build.parts.tables import bill_csv, bill_json, cuts_csv, cuts_json, joints_csv, joints_json

__all__ = [
    "Bar",
    "Stock",
    "stock_bars",
    "stock_csv",
    "stock_json",
    "taps_csv",
    "taps_json",
    "Bill",
    "BillLine",
    "Cut",
    "Prices",
    "bill_csv",
    "bill_json",
    "bill_of_materials",
    "cut_list",
    "cuts_csv",
    "cuts_json",
    "joints_csv",
    "joints_json",
    "must_be_known",
]
