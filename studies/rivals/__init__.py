"""Methods to compare our cells with: trees and small networks."""
